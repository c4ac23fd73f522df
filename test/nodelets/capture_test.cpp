#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <thread>

#include <tabletop_perception/CaptureView.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// A running graph without objects, and a person who teaches it some.
class Capture : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(spinUntil([&] { return camera_.connected(); }));
    ASSERT_TRUE(ros::service::waitForService(SERVICE, 10000));
  }
  void TearDown() override { std::filesystem::remove(databaseFile()); }

  static scene::SyntheticScene blockTurnedBy(double yaw) {
    return scene::render({{"block", scene::steppedBlock(), scene::standing(0, 0, yaw)}});
  }

  /// Calls the service while the camera sends a cloud, or nothing.
  CaptureView::Response capture(const std::string& name, const std::string& object_frame,
                                const Cloud* cloud) {
    CaptureView call;
    call.request.name = name;
    call.request.object_frame = object_frame;
    call.request.timeout = ros::Duration(cloud ? 10 : 1);
    std::atomic<bool> done{false};
    std::thread caller([&] {
      ros::service::call(SERVICE, call);
      done = true;
    });
    spinUntil([&] {
      if (cloud) camera_.send(*cloud);
      return spinUntil([&] { return done.load(); }, 0.3);
    });
    caller.join();
    return call.response;
  }

  /// Has tf say that the turntable is where the block of a scene stands.
  void turnTable(const scene::SyntheticScene& scene) {
    std_msgs::Header header;
    header.frame_id = "camera";
    broadcaster_.sendTransform(
        transformMessage(messageFromPose(scene.objects[0].T_camera_object), header, "turntable"));
    spinUntil([] { return false; }, 0.5);
  }

  void expectRefusal(const CaptureView::Response& response, const std::string& part) {
    EXPECT_FALSE(response.success);
    EXPECT_NE(response.reason.find(part), std::string::npos) << response.reason;
    EXPECT_FALSE(std::filesystem::exists(databaseFile())) << "nothing is begun";
  }

  static constexpr char SERVICE[] = "/perception/capture/capture_view";
  ros::NodeHandle nh_;
  Camera camera_{nh_};
  tf2_ros::StaticTransformBroadcaster broadcaster_;
};

TEST_F(Capture, whatIsShownIsKnownAtTheNextFrame) {
  const auto scene = blockTurnedBy(0.4);
  Recorder<RecognizedObjectArray> objects(nh_, "/perception/refine/objects");
  const auto response = capture("block", "", &scene.cloud);
  ASSERT_TRUE(response.success) << response.reason;
  EXPECT_EQ(response.views, 1u);
  EXPECT_GT(response.points, 40u);
  const auto frame = answerTo(scene.cloud, camera_, objects);
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->objects.size(), 1u);
  EXPECT_EQ(frame->objects[0].name, "block") << frame->objects[0].reason;

  const auto again = capture("block", "", &scene.cloud);
  EXPECT_FALSE(again.success);
  EXPECT_NE(again.reason.find("without an object_frame"), std::string::npos) << again.reason;
}

TEST_F(Capture, viewsOnATurntableBecomeOneObject) {
  unsigned views = 0;
  for (const double yaw : {0.4, 1.6, 2.9}) {
    const auto scene = blockTurnedBy(yaw);
    turnTable(scene);
    const auto response = capture("block", "turntable", &scene.cloud);
    ASSERT_TRUE(response.success) << response.reason;
    EXPECT_EQ(response.views, ++views);
  }
  const auto model = ObjectDatabase(databaseFile(), ObjectDatabase::Mode::READ).load("block");
  ASSERT_EQ(model.views.size(), 3u);
  const auto truth = blockTurnedBy(2.9).objects[0].T_camera_object;
  EXPECT_LT((model.views[2].T_view_object.translation() - truth.translation()).norm(), 1e-4);
}

TEST_F(Capture, anEmptyTableTeachesNothing) {
  const auto scene = scene::render({});
  expectRefusal(capture("block", "", &scene.cloud), "nothing stands on the table");
}

TEST_F(Capture, severalThingsTeachNothing) {
  const auto scene = scene::threeObjects();
  expectRefusal(capture("block", "", &scene.cloud), "3 things stand on the table");
}

TEST_F(Capture, aFrameThatTfDoesNotKnowTeachesNothing) {
  const auto scene = blockTurnedBy(0.4);
  expectRefusal(capture("block", "nowhere", &scene.cloud), "nowhere");
}

TEST_F(Capture, aNameThatIsNoneTeachesNothing) {
  const auto scene = blockTurnedBy(0.4);
  expectRefusal(capture("unknown", "", &scene.cloud), "unknown");
}

TEST_F(Capture, aSilentCameraIsNamed) {
  expectRefusal(capture("block", "", nullptr), "no frame came in time");
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "capture_test");
  return RUN_ALL_TESTS();
}
