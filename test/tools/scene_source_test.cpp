#include "scene_source.h"

#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/String.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "tabletop_perception/pcd.h"
#include "temp_folder.h"

namespace tabletop_perception::tools {
namespace {

namespace fs = std::filesystem;

constexpr char CAMERA[] =
    R"({"camera": {"fx": 100, "fy": 50, "cx": 1, "cy": 0.5, "width": 3, "height": 2},
        "depth_unit_m": 0.001, "up": [0, -2, 0]})";

std::vector<Scene> scenesOf(const std::vector<std::string>& arguments,
                            const std::string& topic = "") {
  std::vector<Scene> scenes;
  visitScenes(arguments, topic, [&](const Scene& scene) { scenes.push_back(scene); });
  return scenes;
}

/// What reading a scene is refused with; empty if it is not.
std::string refusalOf(const std::string& argument, const std::string& topic = "") {
  try {
    scenesOf({argument}, topic);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

::testing::AssertionResult says(const std::string& message, const std::string& file,
                                const std::string& what) {
  if (message.find(file) == std::string::npos || message.find(what) == std::string::npos)
    return ::testing::AssertionFailure() << "\"" << message << "\" lacks the file or " << what;
  if (message.find('\n') != std::string::npos)
    return ::testing::AssertionFailure() << "\"" << message << "\" is not one line";
  return ::testing::AssertionSuccess();
}

Cloud threePoints() {
  Cloud cloud(3, 1, false);
  cloud.setPoint(0, {1, 2, 3});
  cloud.setPoint(2, {4, 5, 6});
  return cloud;
}

/// A folder with a depth image of 3 x 2 pixels: 1 m at column 2 of row 1, nothing elsewhere.
std::string depthFolder(const TempFolder& folder, const std::string& name) {
  cv::Mat depth = cv::Mat::zeros(2, 3, CV_16UC1);
  depth.at<std::uint16_t>(1, 2) = 1000;
  folder.write(name + "/gt.json", CAMERA);
  cv::imwrite(folder.file(name + "/depth.png"), depth);
  return folder.file(name);
}

sensor_msgs::PointCloud2 cloudMessage(double stamp, float x) {
  sensor_msgs::PointCloud2 message;
  message.header.frame_id = "camera";
  message.header.stamp = ros::Time(stamp);
  message.width = message.height = 1;
  message.point_step = message.row_step = 12;
  for (const auto* name : {"x", "y", "z"}) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = 4 * message.fields.size();
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    message.fields.push_back(field);
  }
  const float point[3] = {x, 0, 1};
  message.data.resize(sizeof point);
  std::memcpy(message.data.data(), point, sizeof point);
  return message;
}

/// A bag of two clouds on /points and one message that is no cloud.
std::string twoCloudBag(const TempFolder& folder) {
  rosbag::Bag bag(folder.file("drive.bag"), rosbag::bagmode::Write);
  std_msgs::String text;
  text.data = "hello";
  bag.write("/points", ros::Time(10), cloudMessage(9.5, 1));
  bag.write("/chatter", ros::Time(11), text);
  bag.write("/points", ros::Time(12), cloudMessage(11.25, 2));
  return folder.file("drive.bag");
}

TEST(PcdScene, HasTheFilesPointsAndName) {
  const TempFolder folder;
  PcdContents contents;
  contents.cloud = threePoints();
  writePcd(folder.file("mug.pcd"), contents);
  const auto scenes = scenesOf({folder.file("mug.pcd")});
  ASSERT_EQ(scenes.size(), 1u);
  EXPECT_EQ(scenes[0].name, "mug");
  ASSERT_EQ(scenes[0].cloud.size(), 3u);
  EXPECT_EQ(scenes[0].cloud.point(2), Eigen::Vector3f(4, 5, 6));
  EXPECT_FALSE(scenes[0].cloud.valid(1));
  EXPECT_FALSE(scenes[0].up);
}

TEST(PcdScene, IsMovedSoThatTheSensorIsTheOrigin) {
  const TempFolder folder;
  PcdContents contents;
  contents.cloud = threePoints();
  contents.T_data_sensor =
      Eigen::Translation3d(1, 0, -1) * Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ());
  writePcd(folder.file("mug.pcd"), contents);
  const auto scene = scenesOf({folder.file("mug.pcd")}).at(0);
  EXPECT_EQ(scene.cloud.point(0), Eigen::Vector3f(0, 2, 4));
  EXPECT_EQ(scene.sensor, Eigen::Vector3d(1, 0, -1));
}

TEST(PcdScene, IsRefusedWithTheFileAndTheReason) {
  const TempFolder folder;
  EXPECT_TRUE(says(refusalOf(folder.file("no.pcd")), "no.pcd", "no such file"));
  EXPECT_TRUE(says(refusalOf(folder.write("text.pcd", "hello\n")), "text.pcd", ""));
  EXPECT_TRUE(says(refusalOf(folder.write("mug.xyz", "1 2 3")), "mug.xyz", "not a scene"));

  PcdContents contents;
  contents.cloud = threePoints();
  writePcd(folder.file("cut.pcd"), contents);
  truncateFile(folder.file("cut.pcd"), 0.95);
  EXPECT_TRUE(says(refusalOf(folder.file("cut.pcd")), "cut.pcd", ""));
}

TEST(Scenes, ComeInTheOrderOfTheArguments) {
  const TempFolder folder;
  PcdContents contents;
  contents.cloud = threePoints();
  writePcd(folder.file("b.pcd"), contents);
  writePcd(folder.file("a.pcd"), contents);
  const auto scenes =
      scenesOf({folder.file("b.pcd"), depthFolder(folder, "c"), folder.file("a.pcd")});
  ASSERT_EQ(scenes.size(), 3u);
  EXPECT_EQ(scenes[0].name + scenes[1].name + scenes[2].name, "bca");
}

TEST(Scenes, AMissingArgumentIsFoundBeforeTheFirstIsVisited) {
  const TempFolder folder;
  int visits = 0;
  EXPECT_THROW(visitScenes({depthFolder(folder, "good"), folder.file("missing.pcd")}, "",
                           [&](const Scene&) { ++visits; }),
               std::invalid_argument);
  EXPECT_EQ(visits, 0);
}

TEST(DepthFolder, IsProjectedByItsCamera) {
  const TempFolder folder;
  const auto scene = scenesOf({depthFolder(folder, "frame") + "/"}).at(0);
  EXPECT_EQ(scene.name, "frame");
  EXPECT_EQ(scene.cloud.width, 3);
  EXPECT_EQ(scene.cloud.height, 2);
  EXPECT_EQ(validIndices(scene.cloud), Indices{5});
  // (2 - 1) * 1 m / 100, (1 - 0.5) * 1 m / 50
  EXPECT_TRUE(scene.cloud.point(5).isApprox(Eigen::Vector3f(0.01f, 0.01f, 1), 1e-6f));
  EXPECT_FALSE(scene.cloud.colored());
  ASSERT_TRUE(scene.up);
  EXPECT_EQ(*scene.up, Eigen::Vector3d(0, -1, 0));
}

TEST(DepthFolder, TakesItsColoursFromTheColourImage) {
  const TempFolder folder;
  const auto frame = depthFolder(folder, "frame");
  cv::imwrite(frame + "/color.png", cv::Mat(2, 3, CV_8UC3, cv::Scalar(0x33, 0x22, 0x11)));
  const auto scene = scenesOf({frame}).at(0);
  ASSERT_TRUE(scene.cloud.colored());
  EXPECT_EQ(scene.cloud.rgb[5], 0x112233u);
}

TEST(DepthFolder, MayHaveItsCameraInCameraJson) {
  const TempFolder folder;
  const auto frame = depthFolder(folder, "frame");
  fs::rename(frame + "/gt.json", frame + "/camera.json");
  EXPECT_EQ(scenesOf({frame}).at(0).cloud.size(), 6u);
}

TEST(DepthFolder, IsRefusedWithTheFileAndTheReason) {
  const TempFolder folder;
  const auto bad = [&](const std::string& name, const std::string& json) {
    const auto frame = depthFolder(folder, name);
    folder.write(name + "/gt.json", json);
    return refusalOf(frame);
  };
  EXPECT_TRUE(says(bad("text", "hello"), "text/gt.json", "not valid JSON"));
  EXPECT_TRUE(says(bad("list", "[1]"), "list/gt.json", "camera"));
  EXPECT_TRUE(says(bad("empty", "{}"), "empty/gt.json", "camera"));
  EXPECT_TRUE(says(bad("no_fy", R"({"camera": {"fx": 1}, "depth_unit_m": 1})"), "no_fy", "`fy`"));
  std::string json = CAMERA;
  EXPECT_TRUE(says(bad("unit", json.replace(json.find("0.001"), 5, "-0.01")), "unit/gt.json",
                   "`depth_unit_m` must be positive, got -0.01"));
  json = CAMERA;
  EXPECT_TRUE(says(bad("up", json.replace(json.find("[0, -2, 0]"), 10, "[0, 0, 0] ")), "up/gt.json",
                   "`up` must not be zero"));
  json = CAMERA;
  EXPECT_TRUE(says(bad("up2", json.replace(json.find("[0, -2, 0]"), 10, "[0, 1]    ")),
                   "up2/gt.json", "three numbers, got [0,1]"));
  json = CAMERA;
  EXPECT_TRUE(says(bad("size", json.replace(json.find("\"width\": 3"), 10, "\"width\": 4")),
                   "size/depth.png", "3 x 2 pixels, the camera 4 x 2"));

  fs::create_directory(folder.file("nothing"));
  EXPECT_TRUE(says(refusalOf(folder.file("nothing")), "nothing", "no depth.png"));
  const auto no_json = depthFolder(folder, "no_json");
  fs::remove(no_json + "/gt.json");
  EXPECT_TRUE(says(refusalOf(no_json), "no_json", "neither gt.json nor camera.json"));
  const auto eight_bit = depthFolder(folder, "eight_bit");
  cv::imwrite(eight_bit + "/depth.png", cv::Mat::zeros(2, 3, CV_8UC1));
  EXPECT_TRUE(says(refusalOf(eight_bit), "eight_bit/depth.png", "16 bit"));
  const auto text = depthFolder(folder, "text_depth");
  folder.write("text_depth/depth.png", "hello");
  EXPECT_TRUE(says(refusalOf(text), "text_depth/depth.png", "not a PNG image"));
  const auto cut = depthFolder(folder, "cut");
  truncateFile(cut + "/depth.png", 0.8);
  EXPECT_TRUE(says(refusalOf(cut), "cut/depth.png", "cut short"));
  const auto color = depthFolder(folder, "color");
  cv::imwrite(color + "/color.png", cv::Mat::zeros(4, 3, CV_8UC3));
  EXPECT_TRUE(says(refusalOf(color), "color/color.png", "3 x 4 pixels"));
}

TEST(BagScene, EveryCloudIsASceneWithItsStampAndFrame) {
  const TempFolder folder;
  const auto scenes = scenesOf({twoCloudBag(folder)});
  ASSERT_EQ(scenes.size(), 2u);
  EXPECT_EQ(scenes[0].name, "drive_000000");
  EXPECT_EQ(scenes[1].name, "drive_000001");
  EXPECT_EQ(scenes[0].stamp, 9.5);
  EXPECT_EQ(scenes[1].stamp, 11.25);
  EXPECT_EQ(scenes[1].frame_id, "camera");
  EXPECT_EQ(scenes[1].cloud.point(0), Eigen::Vector3f(2, 0, 1));
}

TEST(BagScene, ATopicHasToBeChosenAmongSeveral) {
  const TempFolder folder;
  {
    rosbag::Bag bag(folder.file("two.bag"), rosbag::bagmode::Write);
    bag.write("/left", ros::Time(1), cloudMessage(1, 1));
    bag.write("/right", ros::Time(2), cloudMessage(2, 2));
  }
  EXPECT_TRUE(says(refusalOf(folder.file("two.bag")), "two.bag", "/left, /right"));
  const auto scenes = scenesOf({folder.file("two.bag")}, "/right");
  ASSERT_EQ(scenes.size(), 1u);
  EXPECT_EQ(scenes[0].name, "two_000000");
  EXPECT_EQ(scenes[0].stamp, 2);
}

TEST(BagScene, IsRefusedWithTheFileAndTheReason) {
  const TempFolder folder;
  EXPECT_TRUE(says(refusalOf(twoCloudBag(folder), "/depth"), "drive.bag",
                   "no topic /depth with clouds in the bag; there is /points"));
  EXPECT_TRUE(says(refusalOf(folder.write("text.bag", "hello\n")), "text.bag", ""));
  EXPECT_TRUE(says(refusalOf(folder.write("empty.bag", "")), "empty.bag", ""));
  {
    rosbag::Bag bag(folder.file("chatter.bag"), rosbag::bagmode::Write);
    bag.write("/chatter", ros::Time(1), std_msgs::String());
  }
  EXPECT_TRUE(says(refusalOf(folder.file("chatter.bag")), "chatter.bag",
                   "no topic of type sensor_msgs/PointCloud2"));
}

TEST(BagScene, ATruncatedBagIsRefused) {
  const TempFolder folder;
  for (const double share : {0.02, 0.3, 0.6, 0.9, 0.99}) {
    const auto file = twoCloudBag(folder);
    truncateFile(file, share);
    EXPECT_TRUE(says(refusalOf(file), "drive.bag", "bag")) << share;
  }
}

TEST(BagScene, ACloudThatDoesNotAddUpIsNamed) {
  const TempFolder folder;
  {
    rosbag::Bag bag(folder.file("bad.bag"), rosbag::bagmode::Write);
    bag.write("/points", ros::Time(1), cloudMessage(1, 1));
    auto short_message = cloudMessage(2, 2);
    short_message.data.resize(4);
    bag.write("/points", ros::Time(2), short_message);
  }
  EXPECT_TRUE(says(refusalOf(folder.file("bad.bag")), "bad.bag", "cloud bad_000001"));
}

std::string sharedData() {
  const char* stated = std::getenv("TABLETOP_DATA");
  return stated ? stated : PROJECT_DIR "/../shared/data";
}

TEST(RealScenes, ARecordedBagIsRead) {
  const auto file = sharedData() + "/jsk/watercan.bag";
  if (!fs::exists(file)) GTEST_SKIP() << "needs " << file;
  const auto scenes = scenesOf({file});
  ASSERT_EQ(scenes.size(), 1u);
  EXPECT_EQ(scenes[0].name, "watercan_000000");
  EXPECT_EQ(scenes[0].frame_id, "/ground");
  EXPECT_EQ(scenes[0].cloud.size(), 13966u);
}

TEST(RealScenes, ADepthFolderLiesWhereItsModelsWerePosed) {
  const auto folder = sharedData() + "/ycbv/0000_000001";
  if (!fs::exists(folder)) GTEST_SKIP() << "needs " << folder;
  const auto scene = scenesOf({folder}).at(0);
  EXPECT_EQ(scene.cloud.width, 640);
  EXPECT_TRUE(scene.cloud.colored());
  // The surface in front of the gelatin box's posed centre is nearer by no more than half the box.
  const Eigen::Vector3d box(-0.030632231, -0.0080317, 0.592640996);
  const int u = std::lround(1066.778 * box.x() / box.z() + 312.9869);
  const int v = std::lround(1067.487 * box.y() / box.z() + 241.3109);
  const auto point = scene.cloud.point(v * 640 + u);
  EXPECT_LT((point.cast<double>() - box).norm(), 0.05);
  EXPECT_LT(point.z(), box.z());
}

}  // namespace
}  // namespace tabletop_perception::tools
