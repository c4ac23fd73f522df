#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>
#include <Eigen/Geometry>

#include "tabletop_perception/label_metrics.h"
#include "tabletop_perception/pcd.h"
#include "tabletop_perception/pipeline.h"

using namespace tabletop_perception;

namespace {

namespace fs = std::filesystem;

fs::path labelledScenes() {
  const char* const data = std::getenv("TABLETOP_DATA");
  return (data ? fs::path(data) : fs::path(PROJECT_DIR) / "../shared/data") / "mosd";
}

/// A labelled Kinect scene and what the default options make of it.
struct ScoredScene {
  std::string name, category;
  Eigen::Vector4d true_plane;  ///< least squares over the points labelled as table
  Segmentation segmentation;
  LabelScore score;
};

std::vector<ScoredScene> scoredScenes() {
  std::vector<ScoredScene> scenes;
  // JSON is YAML; the core's tests need no other reader.
  for (const auto& entry :
       YAML::LoadFile((labelledScenes() / "gt_summary.json").string())["scenes"]) {
    ScoredScene scene;
    const fs::path file = entry["file"].as<std::string>();
    scene.name = file.stem();
    scene.category = entry["category"].as<std::string>();
    for (int i = 0; i < 4; ++i) scene.true_plane[i] = entry["table"]["plane_abcd"][i].as<double>();
    scene.true_plane /= scene.true_plane.head<3>().norm();
    const auto contents = readPcd(labelledScenes() / file.filename());
    scene.segmentation = segmentScene(contents.cloud, std::nullopt, PipelineOptions());
    scene.score = scoreLabels(contents.labels, scene.segmentation.labels());
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

class KinectScenes : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(labelledScenes() / "gt_summary.json"))
      GTEST_SKIP() << labelledScenes() << " is not there";
    static const auto all = scoredScenes();
    scenes_ = &all;
  }

  const std::vector<ScoredScene>* scenes_ = nullptr;
};

}  // namespace

TEST_F(KinectScenes, haveTheirTableWithinATenthOfADegreeAndAMillimetre) {
  for (const auto& scene : *scenes_) {
    SCOPED_TRACE(scene.name);
    ASSERT_TRUE(scene.segmentation.table) << scene.segmentation.reason;
    const Eigen::Vector4d& plane = scene.segmentation.table->plane;
    const double sine = plane.head<3>().cross(scene.true_plane.head<3>()).norm();
    EXPECT_LT(std::asin(sine) * 180 / M_PI, 0.1);
    EXPECT_NEAR(plane[3], scene.true_plane[3], 0.001);
    EXPECT_GE(scene.score.table_iou, 0.97);
  }
}

TEST_F(KinectScenes, comeApartIntoTheirObjects) {
  std::map<std::string, std::vector<LabelScore>> by_category;
  std::vector<LabelScore> all;
  for (const auto& scene : *scenes_) {
    by_category[scene.category].push_back(scene.score);
    all.push_back(scene.score);
  }
  const std::map<std::string, double> least{{"boxes", 0.98},     {"occluded", 0.95},
                                            {"cylindric", 0.93}, {"stacked_boxes", 0.85},
                                            {"mixed", 0.85},     {"complex", 0.80}};
  for (const auto& [category, scores] : by_category)
    EXPECT_GE(summarize(scores).best.f, least.at(category)) << category;
  EXPECT_GE(summarize(all).best.f, 0.93);
  EXPECT_GE(summarize(all).best.foundShare().value_or(0), 0.82);
}
