#include "result_json.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace tabletop_perception::tools {
namespace {

using nlohmann::ordered_json;

/// A table 1 m before the camera, normal to its axis, with a cluster of eight points on it.
Segmentation someSegmentation() {
  Segmentation segmentation;
  segmentation.filtered = Cloud(10, 1, false);
  for (int i = 0; i < 8; ++i)
    segmentation.filtered.setPoint(
        i, {i & 1 ? 0.2f : 0.0f, i & 2 ? 0.1f : 0.0f, i & 4 ? 0.9f : 0.95f});
  segmentation.filtered.setPoint(8, {0.5f, 0.5f, 1.0f});

  Table table;
  table.plane = {0, 0, -1, 1};
  table.T_camera_table.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  table.T_camera_table.translation() = Eigen::Vector3d(0, 0, 1);
  table.hull = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  table.inliers = {8};
  table.rms = 0.002;
  segmentation.table = table;
  segmentation.clusters = {{0, 1, 2, 3, 4, 5, 6, 7}};
  segmentation.times_ms = {{"cluster", 2.5}, {"filter", 1.5}, {"total", 4.0}, {"verify", 0.0}};
  return segmentation;
}

Recognition someRecognition() {
  Recognition recognition;
  recognition.segmentation = someSegmentation();
  SceneObject milk;
  milk.labels = {2, 3};
  milk.name = "milk";
  milk.score = 0.93;
  milk.T_camera_object.translation() = Eigen::Vector3d(0.1, 0.2, 0.9);
  milk.fitness = 0.0012;
  milk.visible = 0.61;
  milk.points = 1234;
  milk.box.size = Eigen::Vector3d(0.3, 0.2, 0.1);
  SceneObject unknown;
  unknown.labels = {4};
  unknown.reason = "margin 0.02, limit 0.05";
  recognition.objects = {milk, unknown};
  recognition.times_ms = {{"total", 10.0}, {"match", 3.0}};
  return recognition;
}

Scene someScene() {
  Scene scene;
  scene.name = "kitchen";
  scene.frame_id = "camera";
  scene.stamp = 12.5;
  return scene;
}

std::vector<std::string> keysOf(const ordered_json& object) {
  std::vector<std::string> keys;
  for (const auto& item : object.items()) keys.push_back(item.key());
  return keys;
}

Eigen::Vector3d vectorOf(const ordered_json& array) {
  return {array.at(0).get<double>(), array.at(1).get<double>(), array.at(2).get<double>()};
}

TEST(SegmentationJson, OtherTablesHaveTheFormOfTheMainOne) {
  auto segmentation = someSegmentation();
  segmentation.other_tables = {*segmentation.table};
  const auto json = segmentationJson(someScene(), segmentation);
  ASSERT_EQ(json["other_tables"].size(), 1u);
  EXPECT_EQ(json["other_tables"][0], json["table"]);
}

TEST(RecognitionJson, HoldsWhatTheDocumentationSays) {
  const auto json = recognitionJson(someScene(), someRecognition());
  EXPECT_EQ(keysOf(json),
            (std::vector<std::string>{"scene", "frame_id", "stamp", "table", "other_tables",
                                      "objects", "times_ms", "reason"}));
  EXPECT_EQ(json["scene"], "kitchen");
  EXPECT_EQ(json["frame_id"], "camera");
  EXPECT_EQ(json["stamp"], 12.5);
  EXPECT_TRUE(json["reason"].is_null());

  const auto& table = json["table"];
  EXPECT_EQ(keysOf(table), (std::vector<std::string>{"plane", "pose", "hull", "inliers", "rms"}));
  EXPECT_EQ(table["plane"], ordered_json({0.0, 0.0, -1.0, 1.0}));
  EXPECT_EQ(table["hull"].size(), 4u);
  EXPECT_EQ(table["inliers"], 1);
  EXPECT_EQ(table["rms"], 0.002);
  EXPECT_EQ(json["other_tables"], ordered_json::array());

  const auto& milk = json["objects"].at(0);
  EXPECT_EQ(keysOf(milk),
            (std::vector<std::string>{"id", "labels", "name", "score", "pose", "covariance",
                                      "free_directions", "fitness", "visible", "points", "box",
                                      "evidence", "reason"}));
  EXPECT_EQ(milk["id"], 1);
  EXPECT_EQ(milk["labels"], ordered_json({2, 3}));
  EXPECT_EQ(milk["name"], "milk");
  EXPECT_EQ(milk["score"], 0.93);
  EXPECT_EQ(milk["pose"]["position"], ordered_json({0.1, 0.2, 0.9}));
  EXPECT_EQ(milk["pose"]["orientation"], ordered_json({0.0, 0.0, 0.0, 1.0}));
  EXPECT_EQ(milk["fitness"], 0.0012);
  EXPECT_EQ(milk["visible"], 0.61);
  EXPECT_EQ(milk["points"], 1234);
  EXPECT_EQ(keysOf(milk["box"]), (std::vector<std::string>{"pose", "size"}));
  EXPECT_EQ(milk["box"]["size"], ordered_json({0.3, 0.2, 0.1}));
  EXPECT_TRUE(milk["reason"].is_null());

  const auto& unknown = json["objects"].at(1);
  EXPECT_EQ(unknown["id"], 2);
  EXPECT_EQ(unknown["name"], "unknown");
  EXPECT_EQ(unknown["reason"], "margin 0.02, limit 0.05");
}

TEST(RecognitionJson, NamesTheTotalTimeLast) {
  const auto json = segmentationJson(someScene(), someSegmentation());
  EXPECT_EQ(keysOf(json["times_ms"]),
            (std::vector<std::string>{"cluster", "filter", "verify", "total"}));
  EXPECT_EQ(json["times_ms"]["total"], 4.0);
}

TEST(RecognitionJson, HasNoTableButAReasonWhereThereIsNone) {
  Recognition recognition;
  recognition.segmentation.reason = "largest plane is 61 deg from up, limit 20";
  const auto json = recognitionJson(someScene(), recognition);
  EXPECT_TRUE(json["table"].is_null());
  EXPECT_TRUE(json["objects"].is_array());
  EXPECT_TRUE(json["objects"].empty());
  EXPECT_TRUE(json["times_ms"].is_object());
  EXPECT_EQ(json["reason"], "largest plane is 61 deg from up, limit 20");
}

TEST(RecognitionJson, IsInTheScenesOwnFrame) {
  auto moved = someScene();
  moved.sensor = Eigen::Vector3d(1, 2, 3);
  const auto there = recognitionJson(moved, someRecognition());
  const auto here = recognitionJson(someScene(), someRecognition());
  const auto shift = [&](const std::string& path) {
    const ordered_json::json_pointer pointer(path);
    return Eigen::Vector3d(vectorOf(there[pointer]) - vectorOf(here[pointer]));
  };
  for (const auto* path : {"/objects/0/pose/position", "/objects/0/box/pose/position",
                           "/table/pose/position", "/table/hull/2"})
    EXPECT_TRUE(shift(path).isApprox(moved.sensor, 1e-12)) << path;
  // The moved hull lies in the moved plane.
  const auto& plane = there["table"]["plane"];
  EXPECT_NEAR(vectorOf(plane).dot(vectorOf(there["table"]["hull"][0])) + plane[3].get<double>(), 0,
              1e-12);
}

TEST(RecognitionJson, OrientationIsAUnitQuaternionWithPositiveW) {
  auto recognition = someRecognition();
  recognition.objects[0].T_camera_object.linear() =
      Eigen::AngleAxisd(-3.1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const auto json = recognitionJson(someScene(), recognition);
  const auto& q = json["objects"][0]["pose"]["orientation"];
  EXPECT_GE(q[3].get<double>(), 0);
  EXPECT_NEAR(vectorOf(q).squaredNorm() + std::pow(q[3].get<double>(), 2), 1, 1e-12);
}

TEST(RecognitionJson, IsOneLineWhateverTheName) {
  auto scene = someScene();
  scene.name = "caf\xe9\n";
  const auto line = jsonLine(recognitionJson(scene, someRecognition()));
  EXPECT_EQ(line.find('\n'), line.size() - 1);
  EXPECT_NO_THROW(ordered_json::parse(line));
}

TEST(SegmentationJson, IsTheSameWithoutNamesAndScores) {
  const auto json = segmentationJson(someScene(), someSegmentation());
  EXPECT_EQ(json["table"], recognitionJson(someScene(), someRecognition())["table"]);
  const auto& object = json["objects"].at(0);
  EXPECT_EQ(keysOf(object), (std::vector<std::string>{"id", "labels", "pose", "fitness", "visible",
                                                      "points", "box", "reason"}));
  EXPECT_EQ(object["labels"], ordered_json({2}));
  EXPECT_EQ(object["points"], 8);
  EXPECT_EQ(object["pose"], object["box"]["pose"]);
  EXPECT_TRUE(vectorOf(object["box"]["size"]).isApprox(Eigen::Vector3d(0.2, 0.1, 0.05), 1e-6));
  EXPECT_TRUE(
      vectorOf(object["pose"]["position"]).isApprox(Eigen::Vector3d(0.1, 0.05, 0.925), 1e-6));
}

}  // namespace
}  // namespace tabletop_perception::tools
