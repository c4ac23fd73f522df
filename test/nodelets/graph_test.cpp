#include <gtest/gtest.h>

#include <set>

#include <tf2_eigen/tf2_eigen.h>
#include <tf2_ros/transform_listener.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

constexpr double MAX_SHIFT = 0.003;          ///< [m]
constexpr double MAX_TURN = 2 * M_PI / 180;  ///< [rad]

/// The scene of three objects, trained and running through the graph.
class Graph : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    trainObjects(scene::threeObjects().objects, databaseFile());
    ASSERT_TRUE(warmUp(scene::threeObjects().cloud, shared().camera, shared().objects));
  }
  static void TearDownTestSuite() { std::filesystem::remove(databaseFile()); }

  struct Shared {
    ros::NodeHandle nh;
    Camera camera{nh};
    Recorder<RecognizedObjectArray> objects{nh, "/perception/refine/objects"};
    Recorder<TableMessage> tables{nh, "/perception/table/table"};
    Recorder<TableArray> all_tables{nh, "/perception/table/tables"};
    Recorder<CandidateArray> candidates{nh, "/perception/match/candidates"};
    Recorder<sensor_msgs::PointCloud2> clusters{nh, "/perception/match/clusters"};
    Recorder<sensor_msgs::PointCloud2> models{nh, "/perception/markers/models"};
    tf2_ros::Buffer tf{ros::Duration(60)};
    tf2_ros::TransformListener tf_listener{tf};
  };
  static Shared& shared() {
    static Shared shared;
    return shared;
  }

  Camera& camera_ = shared().camera;
  Recorder<RecognizedObjectArray>& objects_ = shared().objects;
  tf2_ros::Buffer& tf_ = shared().tf;
  const scene::SyntheticScene scene_ = scene::threeObjects();
};

const RecognizedObject* find(const RecognizedObjectArray& frame, const std::string& name) {
  for (const auto& object : frame.objects)
    if (object.name == name) return &object;
  return nullptr;
}

void expectSamePose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double shift,
                    double turn) {
  EXPECT_LT((a.translation() - b.translation()).norm(), shift);
  EXPECT_LT(angleOf(a.linear().transpose() * b.linear()), turn);
}

TEST_F(Graph, threeObjectsHaveTheirNamesAndPoses) {
  const auto frame = answerTo(scene_.cloud, camera_, objects_);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->objects.size(), 3u);
  for (const auto& truth : scene_.objects) {
    SCOPED_TRACE(truth.name);
    const auto* object = find(*frame, truth.name);
    ASSERT_TRUE(object) << "reason: " << frame->reason;
    expectSamePose(poseFromMessage(object->pose), truth.T_camera_object, MAX_SHIFT, MAX_TURN);
    EXPECT_GT(object->score, 0.5);
    EXPECT_TRUE(object->reason.empty()) << object->reason;
  }
}

TEST_F(Graph, everyMessageOfAFrameHasItsStampAndFrame) {
  const auto stamp = camera_.send(scene_.cloud);
  auto& s = shared();
  ASSERT_TRUE(spinUntil([&] {
    return s.objects.has(stamp) && s.tables.has(stamp) && s.candidates.has(stamp) &&
           s.clusters.has(stamp) && s.models.has(stamp);
  }));
  EXPECT_EQ(s.objects.at(stamp)->header.frame_id, "camera");
  EXPECT_EQ(s.tables.at(stamp)->header.frame_id, "camera");
  EXPECT_EQ(s.candidates.at(stamp)->header.frame_id, "camera");
  EXPECT_EQ(s.clusters.at(stamp)->header.frame_id, "camera");
  EXPECT_EQ(s.models.at(stamp)->header.frame_id, "camera");
  EXPECT_EQ(s.clusters.at(stamp)->width, 640u);
  EXPECT_EQ(s.clusters.at(stamp)->height, 480u);
  for (const auto& object : s.objects.at(stamp)->objects) EXPECT_EQ(object.header.stamp, stamp);
}

TEST_F(Graph, namesAndIdsStayOverNoisyFrames) {
  std::set<std::string> frames;
  for (unsigned seed = 0; seed < 10; ++seed) {
    Cloud cloud = scene_.cloud;
    scene::addAxialNoise(cloud, 0.0005, seed);
    const auto frame = answerTo(cloud, camera_, objects_);
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->objects.size(), 3u);
    for (const auto& object : frame->objects) frames.insert(object.child_frame_id);
  }
  EXPECT_EQ(frames.size(), 3u);
  for (const auto& truth : scene_.objects) {
    const auto first = frames.lower_bound(truth.name + "_");
    ASSERT_NE(first, frames.end());
    EXPECT_EQ(first->rfind(truth.name + "_", 0), 0u) << *first;
  }
}

TEST_F(Graph, theTablesFrameLiesOnItWithZUp) {
  const auto stamp = camera_.send(scene_.cloud);
  ASSERT_TRUE(spinUntil([&] { return tf_.canTransform("camera", "table", stamp); }));
  const Eigen::Isometry3d T_camera_table =
      tf2::transformToEigen(tf_.lookupTransform("camera", "table", stamp));
  const double tilt = std::acos(T_camera_table.linear().col(2).dot(scene_.up));
  EXPECT_LT(tilt, 0.1 * M_PI / 180);
  const double height = scene_.plane.head<3>().dot(T_camera_table.translation()) + scene_.plane[3];
  EXPECT_LT(std::abs(height), 0.001);
  EXPECT_GT(T_camera_table.linear().col(0).z(), 0.5) << "x points away from the camera";
}

TEST_F(Graph, aSecondTableComesOutWithWhatStandsOnIt) {
  scene::SceneOptions options;
  options.table_x = options.table_y = 0.5;
  const auto scene = scene::render(
      {{"house", scene::painted(scene::house(), scene::HOUSE_COLOR), scene::standing(0, 0, 0.5)},
       {"board", scene::moved(scene::box(0.5, 0.4, 0.02), 0, 0.5, -0.2), scene::standing(0, 0, 0)},
       {"bracket",
        scene::moved(scene::painted(scene::bracket(), scene::BRACKET_COLOR), 0, 0.45, -0.18),
        scene::standing(0, 0, 0)}},
      options);
  const auto stamp = camera_.send(scene.cloud);
  auto& s = shared();
  ASSERT_TRUE(spinUntil(
      [&] { return s.objects.has(stamp) && s.tables.has(stamp) && s.all_tables.has(stamp); }));
  const auto& tables = s.all_tables.at(stamp)->tables;
  ASSERT_EQ(tables.size(), 2u) << s.all_tables.at(stamp)->reason;
  EXPECT_EQ(tables[0].plane, s.tables.at(stamp)->plane) << "the main one is the first";
  EXPECT_NEAR(tables[1].plane[3] - tables[0].plane[3], 0.18, 0.002);

  const auto frame = s.objects.at(stamp);
  for (const std::string name : {"house", "bracket"})
    EXPECT_TRUE(find(*frame, name)) << name << " of " << frame->objects.size() << " objects";
}

TEST_F(Graph, messageTfAndServiceAgree) {
  GetObjectPose::Request request;
  request.timeout = ros::Duration(10);
  const auto reply =
      getObjectPose("/perception/refine/get_object_pose", request, &camera_, scene_.cloud);
  ASSERT_TRUE(reply.success) << reply.reason;
  ASSERT_EQ(reply.objects.size(), 3u);

  const auto stamp = reply.objects[0].header.stamp;
  ASSERT_TRUE(spinUntil([&] { return objects_.has(stamp); }))
      << "the service answered from a frame that was published";
  for (const auto& object : reply.objects) {
    SCOPED_TRACE(object.name);
    const auto* published = find(*objects_.at(stamp), object.name);
    ASSERT_TRUE(published);
    EXPECT_EQ(published->id, object.id);
    const Eigen::Isometry3d pose = poseFromMessage(object.pose);
    expectSamePose(pose, poseFromMessage(published->pose), 1e-9, 1e-6);
    ASSERT_TRUE(
        spinUntil([&] { return tf_.canTransform("camera", object.child_frame_id, stamp); }));
    expectSamePose(
        pose, tf2::transformToEigen(tf_.lookupTransform("camera", object.child_frame_id, stamp)),
        1e-6, 1e-5);
  }
}

TEST_F(Graph, theServiceAnswersInAnotherFrame) {
  GetObjectPose::Request request;
  request.name = "house";
  request.target_frame = "table";
  request.timeout = ros::Duration(10);
  const auto reply =
      getObjectPose("/perception/refine/get_object_pose", request, &camera_, scene_.cloud);
  ASSERT_TRUE(reply.success) << reply.reason;
  ASSERT_EQ(reply.objects.size(), 1u);
  EXPECT_EQ(reply.objects[0].header.frame_id, "table");
  EXPECT_NEAR(reply.objects[0].pose.position.z, 0, MAX_SHIFT) << "it stands on the table";
}

TEST_F(Graph, modelsLieOnTheSurfacesThatTheCameraSaw) {
  const auto stamp = camera_.send(scene_.cloud);
  ASSERT_TRUE(spinUntil([&] { return shared().models.has(stamp); }));
  const Cloud models = cloudFromMessage(*shared().models.at(stamp));
  ASSERT_GT(models.size(), 1000u);
  const Eigen::Isometry3d T_table_camera = scene_.T_camera_table.inverse();
  for (std::size_t i = 0; i < models.size(); ++i) {
    const double height = (T_table_camera * models.point(i).cast<double>()).z();
    ASSERT_GT(height, -2 * MAX_SHIFT);
    ASSERT_LT(height, 0.15);
  }
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "graph_test");
  return RUN_ALL_TESTS();
}
