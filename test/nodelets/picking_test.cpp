#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <thread>
#include <vector>

#include <geometry_msgs/PointStamped.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// A running graph without a database, and a person who clicks.
class Picking : public testing::Test {
 protected:
  Picking()
      : clicks_(nh_.advertise<geometry_msgs::PointStamped>("/clicked_point", 5)),
        pixels_(nh_.advertise<geometry_msgs::PointStamped>("/perception/pick/clicked_pixel", 5)),
        picked_(nh_.subscribe<PickedObject>(
            "/perception/pick/picked", 50,
            [this](const auto& message) { answers_.push_back(*message); })),
        tf_(nh_.subscribe<tf2_msgs::TFMessage>("/tf", 500, [this](const auto& message) {
          for (const auto& transform : message->transforms)
            if (transform.child_frame_id == "picked" || transform.child_frame_id == "pregrasp")
              frames_.push_back(transform);
        })) {}

  void SetUp() override {
    ASSERT_TRUE(spinUntil([&] {
      return camera_.connected() && clicks_.getNumSubscribers() > 0 &&
             pixels_.getNumSubscribers() > 0 && picked_.getNumPublishers() > 0;
    }));
  }

  static geometry_msgs::PointStamped pointAt(const Eigen::Vector3d& p,
                                             const std::string& frame = "camera") {
    geometry_msgs::PointStamped point;
    point.header.frame_id = frame;
    point.header.stamp = ros::Time::now();
    point.point = messageFromPoint(p);
    return point;
  }

  /// Sends frames until so many answers are there.
  bool answered(std::size_t count, bool with_camera = true) {
    const auto end = ros::WallTime::now() + ros::WallDuration(15);
    while (answers_.size() < count && ros::WallTime::now() < end) {
      if (with_camera) last_stamp_ = camera_.send(scene_.cloud);
      spinUntil([&] { return answers_.size() >= count; }, 0.3);
    }
    return answers_.size() >= count;
  }

  /// The only answer to a click, which has to be a refusal that says `part`, without a frame in tf.
  void expectRefusal(const std::string& part, bool with_camera = true) {
    ASSERT_TRUE(answered(1, with_camera));
    spinUntil([] { return false; }, 0.3);
    EXPECT_FALSE(answers_[0].success);
    EXPECT_NE(answers_[0].reason.find(part), std::string::npos) << answers_[0].reason;
    EXPECT_TRUE(frames_.empty());
  }

  Eigen::Vector3d inCamera(const Eigen::Vector3d& in_table) const {
    return scene_.T_camera_table * in_table;
  }

  scene::SyntheticScene scene_ =
      scene::render({{"box", scene::box(0.12, 0.06, 0.10), scene::standing(0, 0, 0.3)}});
  const Eigen::Vector3d top_ = inCamera({0, 0, 0.10});
  ros::NodeHandle nh_;
  Camera camera_{nh_};
  ros::Publisher clicks_, pixels_;
  ros::Subscriber picked_, tf_;
  visualization_msgs::MarkerArrayConstPtr drawn_;
  ros::Subscriber markers_ = nh_.subscribe<visualization_msgs::MarkerArray>(
      "/perception/pick/markers", 5, [this](const auto& message) { drawn_ = message; });
  std::vector<PickedObject> answers_;
  std::vector<geometry_msgs::TransformStamped> frames_;
  ros::Time last_stamp_;
};

TEST_F(Picking, aClickedPointGivesAFrameOnTheThing) {
  clicks_.publish(pointAt(top_));
  ASSERT_TRUE(answered(1));
  const auto& answer = answers_[0];
  ASSERT_TRUE(answer.success) << answer.reason;
  EXPECT_EQ(answer.header.frame_id, "camera");
  const Eigen::Vector3d origin =
      scene_.T_camera_table.inverse() * pointFromMessage(answer.pose.position);
  EXPECT_LT((origin - Eigen::Vector3d(0, 0, 0.08)).norm(), 0.005);
  EXPECT_NEAR(answer.width, 0.08, 0.01);
  ASSERT_TRUE(spinUntil([&] { return frames_.size() == 2; }, 5));
  EXPECT_EQ(frames_[0].child_frame_id, "picked");
  EXPECT_EQ(frames_[1].child_frame_id, "pregrasp");
  EXPECT_EQ(frames_[0].header.stamp, answer.header.stamp);
}

TEST_F(Picking, aClickedPixelGivesTheSame) {
  const Eigen::Vector2d pixel = scene::SceneOptions().projection.pixel(top_);
  pixels_.publish(pointAt({pixel.x(), pixel.y(), 0}));
  ASSERT_TRUE(answered(1));
  EXPECT_TRUE(answers_[0].success) << answers_[0].reason;
}

TEST_F(Picking, inTheAir) {
  clicks_.publish(pointAt(inCamera({0, 0, 0.3})));
  expectRefusal("in the air");
}

TEST_F(Picking, onTheTable) {
  clicks_.publish(pointAt(inCamera({0, 0.25, 0})));
  expectRefusal("on the table");
}

TEST_F(Picking, onTheWall) {
  scene_ = scene::render({{"box", scene::box(0.12, 0.06, 0.10), scene::standing(0, 0, 0)},
                          {"wall", scene::box(0.02, 1.6, 0.8), scene::standing(0.7, 0, 0)}});
  clicks_.publish(pointAt(inCamera({0.69, 0, 0.2})));
  expectRefusal("on nothing that stands on a table");
}

TEST_F(Picking, aPixelWithoutDepthNearby) {
  for (int v = 80; v < 120; ++v)
    for (int u = 80; u < 120; ++u) scene_.cloud.drop(v * scene_.cloud.width + u);
  pixels_.publish(pointAt({100, 100, 0}));
  expectRefusal("no depth within 11 x 11 pixels about (100, 100)");
}

TEST_F(Picking, aRefusalAfterAPickSendsNoFrameAndTakesTheMarkersAway) {
  clicks_.publish(pointAt(top_));
  ASSERT_TRUE(answered(1));
  ASSERT_TRUE(answers_[0].success) << answers_[0].reason;
  ASSERT_TRUE(spinUntil([&] { return frames_.size() == 2 && drawn_; }, 5));
  EXPECT_GT(drawn_->markers.size(), 1u);
  frames_.clear();
  clicks_.publish(pointAt(inCamera({0, 0, 0.3})));
  ASSERT_TRUE(answered(2));
  ASSERT_TRUE(spinUntil([&] { return drawn_->markers.size() == 1; }, 5));
  EXPECT_EQ(drawn_->markers[0].action, visualization_msgs::Marker::DELETEALL);
  EXPECT_FALSE(answers_[1].success);
  EXPECT_TRUE(frames_.empty());
}

TEST_F(Picking, outsideTheImage) {
  pixels_.publish(pointAt({640, 10, 0}));
  expectRefusal("outside the image of 640 x 480");
}

TEST_F(Picking, notFinite) {
  clicks_.publish(pointAt({std::numeric_limits<double>::quiet_NaN(), 0, 1}));
  expectRefusal("not finite");
}

TEST_F(Picking, inAnUnknownFrame) {
  clicks_.publish(pointAt(top_, "nowhere"));
  expectRefusal("nowhere");
}

TEST_F(Picking, olderThanTfRemembers) {
  auto point = pointAt(top_);
  point.header.stamp = ros::Time::now() - ros::Duration(25);
  clicks_.publish(point);
  expectRefusal("older than the cloud");
}

TEST_F(Picking, withoutACloud) {
  clicks_.publish(pointAt(top_));
  expectRefusal("no cloud came in time", false);
}

TEST_F(Picking, ofTwoClicksAtOnceTheLaterOneCounts) {
  clicks_.publish(pointAt(inCamera({0, 0.25, 0})));
  clicks_.publish(pointAt(top_));
  ASSERT_TRUE(answered(2));
  EXPECT_FALSE(answers_[0].success);
  EXPECT_NE(answers_[0].reason.find("another point was clicked"), std::string::npos)
      << answers_[0].reason;
  EXPECT_TRUE(answers_[1].success) << answers_[1].reason;
}

TEST_F(Picking, theServiceAnswersWithTheThingAndWithTheReason) {
  const auto call = [&](const geometry_msgs::PointStamped& point) {
    EstimatePoseAt service;
    service.request.point = point;
    service.request.timeout = ros::Duration(4);
    std::atomic<bool> done{false};
    std::thread client([&] {
      EXPECT_TRUE(ros::service::call("/perception/pick/estimate_pose_at", service));
      done = true;
    });
    while (!done) {
      camera_.send(scene_.cloud);
      spinUntil([&] { return done.load(); }, 0.3);
    }
    client.join();
    return service.response;
  };
  const auto good = call(pointAt(top_));
  EXPECT_TRUE(good.success) << good.reason;
  EXPECT_EQ(good.picked.object.name, "unknown");
  const auto bad = call(pointAt(inCamera({0, 0, 0.3})));
  EXPECT_FALSE(bad.success);
  EXPECT_NE(bad.reason.find("in the air"), std::string::npos) << bad.reason;
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "picking_test");
  ros::NodeHandle nh;  // keeps the node up between the tests
  return RUN_ALL_TESTS();
}
