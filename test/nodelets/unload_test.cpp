#include <gtest/gtest.h>

#include <set>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <nodelet/loader.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// Nodelets and this test in one process, as in one manager.
TEST(Unload, aNodeletMayGoWhileItWorks) {
  nodelet::Loader manager(false);
  const auto load = [&](const std::string& name, const std::string& input) {
    const std::string own = "/" + name;
    return manager.load(own, "tabletop_perception/" + name, {{own + "/input", input}}, {});
  };
  ASSERT_TRUE(load("filter", "/camera/depth_registered/points"));
  ASSERT_TRUE(load("table", "/filter/cloud"));
  ros::NodeHandle nh;
  Camera camera(nh);
  const Cloud cloud = scene::threeObjects().cloud;
  for (int i = 0; i < 20; ++i) {
    ASSERT_TRUE(load("cluster", "/table/objects"));
    Recorder<sensor_msgs::PointCloud2> clusters(nh, "/cluster/clusters");
    ASSERT_TRUE(spinUntil([&] {
      camera.send(cloud);
      return spinUntil([&] { return !clusters.all().empty(); }, 0.1);
    })) << "load "
        << i;
    camera.send(cloud);
    spinUntil([] { return false; }, 0.001 * i);  // into another part of its work each time
    ASSERT_TRUE(manager.unload("/cluster"));
  }
}

/// A database is read at the start, though nobody listens: who calls a sleeping graph does not wait
/// for that.
TEST(Unload, aNodeletMayGoWhileItReadsItsDatabaseWhichItDoesAtOnce) {
  const std::filesystem::path file =
      "/tmp/unload_test_" + std::to_string(ros::WallTime::now().toNSec()) + ".db";
  trainObjects(scene::threeObjects().objects, file);
  ros::NodeHandle nh;
  const std::set<std::string> nodelets = {"match", "refine"};
  for (const auto& name : nodelets) nh.setParam("/" + name + "/database", file.string());
  std::set<std::string> ready;
  const auto diagnostics =
      nh.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 100, [&](const auto& message) {
        for (const auto& status : message->status)
          for (const auto& value : status.values)
            if (status.message == "asleep: nobody listens" && value.key == "objects known" &&
                value.value == "3")
              for (const auto& name : nodelets)
                if (status.name == name + ": frames") ready.insert(name);
      });

  nodelet::Loader manager(false);
  const auto load = [&](const std::string& name) {
    return manager.load("/" + name, "tabletop_perception/" + name, {}, {});
  };
  nh.setParam("/refine/publish_tf", false);
  for (int i = 0; i < 20; ++i) {
    for (const auto& name : nodelets) ASSERT_TRUE(load(name)) << "load " << i;
    spinUntil([] { return false; }, 0.005 * i);  // into another part of its work each time
    for (const auto& name : nodelets) ASSERT_TRUE(manager.unload("/" + name));
  }
  for (const auto& name : nodelets) ASSERT_TRUE(load(name));
  EXPECT_TRUE(spinUntil([&] { return ready == nodelets; })) << ready.size() << " are ready";
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "unload_test");
  return RUN_ALL_TESTS();
}
