#include <gtest/gtest.h>
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

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "unload_test");
  return RUN_ALL_TESTS();
}
