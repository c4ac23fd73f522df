#include <gtest/gtest.h>

#include <geometry_msgs/PointStamped.h>
#include <geometry_msgs/PoseArray.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// A grasp of a standing object from `approach`, `height` above its foot.
StoredGrasp graspFrom(const std::string& name, const Eigen::Vector3d& approach, double height,
                      double preference) {
  StoredGrasp grasp;
  grasp.name = name;
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  grasp.T_object_gripper.linear() << y.cross(approach), y, approach;
  grasp.T_object_gripper.translation() = Eigen::Vector3d(0, 0, height);
  grasp.width = 0.08;
  grasp.preference = preference;
  return grasp;
}

/// A house on a table, known, with three grasps; and a robot beside the camera.
class Grasps : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    trainObjects(sceneOfHouse().objects, databaseFile());
    ObjectDatabase database(databaseFile(), ObjectDatabase::Mode::WRITE);
    const Eigen::Vector3d down(0, 0, -1), up(0, 0, 1);
    database.storeGrasp("house", graspFrom("top", down, 0.10, 1));
    database.storeGrasp("house", graspFrom("ridge", down, 0.11, 5));
    database.storeGrasp("house", graspFrom("floor", up, 0.02, 9));
    geometry_msgs::TransformStamped transform =
        transformMessage(messageFromPose(T_robot_camera()), std_msgs::Header(), "camera");
    transform.header.frame_id = "robot";
    static tf2_ros::StaticTransformBroadcaster broadcaster;
    broadcaster.sendTransform(transform);
    ASSERT_TRUE(warmUp(sceneOfHouse().cloud, shared().camera, shared().objects));
  }
  static void TearDownTestSuite() { std::filesystem::remove(databaseFile()); }

  static scene::SyntheticScene sceneOfHouse() {
    return scene::render({{"house", scene::house(), scene::standing(0, 0, 0.4)}});
  }
  static Eigen::Isometry3d T_robot_camera() {
    return Eigen::Translation3d(1, 2, 3) *
           Eigen::Isometry3d(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()));
  }

  struct Shared {
    ros::NodeHandle nh;
    Camera camera{nh};
    Recorder<RecognizedObjectArray> objects{nh, "/perception/refine/objects"};
  };
  static Shared& shared() {
    static Shared shared;
    return shared;
  }

  Grasps()
      : clicks_(nh_.advertise<geometry_msgs::PointStamped>("/clicked_point", 5)),
        picked_(nh_.subscribe<PickedObject>("/perception/pick/picked", 5,
                                            [this](const auto& message) { answer_ = message; })),
        grasps_(nh_.subscribe<geometry_msgs::PoseArray>(
            "/perception/pick/grasps", 5,
            [this](const auto& message) { offered_.push_back(*message); })),
        model_(nh_.subscribe<sensor_msgs::PointCloud2>(
            "/perception/pick/model", 5, [this](const auto& message) { shown_ = message; })),
        asked_(nh_.subscribe<geometry_msgs::PoseArray>(
            "/perception/refine/grasps", 5,
            [this](const auto& message) { of_service_.push_back(*message); })),
        tf_(nh_.subscribe<tf2_msgs::TFMessage>("/tf", 500, [this](const auto& message) {
          for (const auto& transform : message->transforms)
            if (transform.child_frame_id == "picked_model") model_frames_.push_back(transform);
        })) {}

  void SetUp() override {
    ASSERT_TRUE(spinUntil([&] {
      return clicks_.getNumSubscribers() > 0 && picked_.getNumPublishers() > 0 &&
             grasps_.getNumPublishers() > 0 && model_.getNumPublishers() > 0;
    }));
    spinUntil([] { return false; }, 0.5);  // what was latched before
    offered_.clear();
    of_service_.clear();
    shown_.reset();
    answer_.reset();
  }

  /// Clicks at a point of the table's frame and sends frames until the answer is whole.
  bool click(const Eigen::Vector3d& in_table) {
    geometry_msgs::PointStamped point;
    point.header.frame_id = "camera";
    point.header.stamp = ros::Time::now();
    point.point = messageFromPoint(scene_.T_camera_table * in_table);
    clicks_.publish(point);
    const auto end = ros::WallTime::now() + ros::WallDuration(15);
    const auto whole = [&] { return answer_ && shown_ && !offered_.empty(); };
    while (!whole() && ros::WallTime::now() < end) {
      shared().camera.send(scene_.cloud);
      spinUntil(whole, 0.5);
    }
    return whole();
  }

  const scene::SyntheticScene scene_ = sceneOfHouse();
  ros::NodeHandle nh_;
  ros::Publisher clicks_;
  ros::Subscriber picked_, grasps_, model_, asked_, tf_;
  PickedObjectConstPtr answer_;
  sensor_msgs::PointCloud2ConstPtr shown_;
  std::vector<geometry_msgs::PoseArray> offered_, of_service_;
  std::vector<geometry_msgs::TransformStamped> model_frames_;
};

TEST_F(Grasps, ofAPickedObjectAreOfferedInThePlanningFrameWithoutTheOneFromBelow) {
  ASSERT_TRUE(click({0, 0, 0.06}));
  ASSERT_TRUE(answer_->success) << answer_->reason;
  ASSERT_EQ(answer_->object.name, "house") << answer_->reason;
  const auto& all = answer_->object.grasps;
  ASSERT_EQ(all.size(), 3u);
  EXPECT_EQ(all[0].name, "floor");
  EXPECT_NE(all[0].reason.find("below the table"), std::string::npos) << all[0].reason;
  EXPECT_EQ(all[1].name, "ridge");
  EXPECT_EQ(all[1].reason, "");
  EXPECT_EQ(all[1].width, 0.08);
  EXPECT_EQ(all[2].name, "top");

  const auto& offered = offered_.back();
  EXPECT_EQ(offered.header.frame_id, "robot");
  EXPECT_EQ(offered.header.stamp, answer_->header.stamp);
  ASSERT_EQ(offered.poses.size(), 2u);
  const Eigen::Isometry3d ridge = T_robot_camera() * scene_.objects[0].T_camera_object *
                                  graspFrom("", {0, 0, -1}, 0.11, 0).T_object_gripper;
  const Eigen::Isometry3d first = poseFromMessage(offered.poses[0]);
  EXPECT_LT((first.translation() - ridge.translation()).norm(), 0.005);
  EXPECT_LT(angleOf(first.linear().transpose() * ridge.linear()), 0.05);
}

TEST_F(Grasps, theModelIsShownAtItsPoseWithAFrameAtItsCentroid) {
  ASSERT_TRUE(click({0, 0, 0.06}));
  ASSERT_TRUE(answer_->success) << answer_->reason;
  EXPECT_EQ(shown_->header.frame_id, "camera");
  const Cloud model = cloudFromMessage(*shown_);
  ASSERT_GT(model.size(), 100u);
  ASSERT_TRUE(spinUntil([&] { return !model_frames_.empty(); }, 5));
  const auto& t = model_frames_.back().transform.translation;
  const Eigen::Vector3f centroid = centroidOf(pointsAt(model, validIndices(model)));
  EXPECT_LT((Eigen::Vector3d(t.x, t.y, t.z) - centroid.cast<double>()).norm(), 1e-4);
}

TEST_F(Grasps, nothingIsOfferedWhereNothingIsPicked) {
  ASSERT_TRUE(click({0, 0, 0.4}));
  EXPECT_FALSE(answer_->success);
  EXPECT_TRUE(offered_.back().poses.empty());
  EXPECT_EQ(shown_->width * shown_->height, 0u);
  EXPECT_TRUE(model_frames_.empty());
}

TEST_F(Grasps, ofARecognisedObjectComeWithTheServicesAnswerInItsFrame) {
  GetObjectPose::Request request;
  request.name = "house";
  request.target_frame = "robot";
  request.timeout = ros::Duration(8);
  const auto response =
      getObjectPose("/perception/refine/get_object_pose", request, &shared().camera, scene_.cloud);
  ASSERT_TRUE(response.success) << response.reason;
  ASSERT_EQ(response.objects[0].grasps.size(), 3u);
  EXPECT_NE(response.objects[0].grasps[0].reason, "");
  ASSERT_TRUE(spinUntil([&] { return !of_service_.empty(); }, 5));
  const auto& offered = of_service_.back();
  EXPECT_EQ(offered.header.frame_id, "robot");
  ASSERT_EQ(offered.poses.size(), 2u);
  EXPECT_NEAR(offered.poses[0].position.x, response.objects[0].grasps[1].pose.position.x, 1e-9);
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "grasps_test");
  ros::NodeHandle nh;  // keeps the node up between the tests
  return RUN_ALL_TESTS();
}
