#include <gtest/gtest.h>
#include <nodelet/loader.h>

#include "cloud_message.h"
#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// Nodelets and this test in one process, as in one manager.
TEST(ZeroCopy, nodeletsPassTheSameMessageOn) {
  nodelet::Loader manager(false);
  const auto load = [&](const std::string& name, const std::string& input) {
    const std::string own = "/" + name;
    return manager.load(own, "tabletop_perception/" + name,
                        {{own + "/input", input},
                         {own + "/tables", "/table/tables"},
                         {own + "/cloud", "/filter/cloud"}},
                        {});
  };
  ASSERT_TRUE(load("filter", "/camera/depth_registered/points"));
  ASSERT_TRUE(load("table", "/filter/cloud"));
  ASSERT_TRUE(load("cluster", "/table/objects"));
  ASSERT_TRUE(load("match", "/cluster/clusters"));

  ros::NodeHandle nh;
  Camera camera(nh);
  Recorder<CloudMessage> published(nh, "/cluster/clusters");
  Recorder<CloudMessage> passed_on(nh, "/match/clusters");
  const Cloud cloud = scene::threeObjects().cloud;
  ros::Time stamp;
  ASSERT_TRUE(spinUntil([&] {
    stamp = camera.send(cloud);
    return spinUntil([&] { return published.has(stamp) && passed_on.has(stamp); }, 1);
  }));

  // match publishes the message that it got from cluster: all three of them hold the same one.
  EXPECT_EQ(published.at(stamp), passed_on.at(stamp));
  EXPECT_EQ(published.at(stamp)->cloud().x.data(), passed_on.at(stamp)->cloud().x.data());
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "zero_copy_test");
  return RUN_ALL_TESTS();
}
