#include "benchmark_recognition.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "clouds.h"
#include "scene.h"
#include "stock_recognition.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/refine.h"
#include "tabletop_perception/train.h"
#include "views.h"

namespace tabletop_perception::tools {
namespace {

const ModelIndex& threeModels() {
  static const ModelIndex index = [] {
    std::vector<ObjectModel> models;
    for (const auto& object : scene::threeObjects().objects)
      models.push_back(trainFromMesh(object.name, object.mesh, DescriptorOptions(), {}));
    return ModelIndex(std::move(models));
  }();
  return index;
}

std::vector<std::string> namesOf(const std::vector<StageTiming>& stages) {
  std::vector<std::string> names;
  for (const auto& stage : stages) names.push_back(stage.name);
  return names;
}

TEST(BenchmarkRecognition, TimesTheStagesOnWhatStandsInTheScene) {
  const auto scene = scene::threeObjects();
  const auto segmentation = segmentScene(scene.cloud, scene.up, PipelineOptions());
  const auto stages = benchmarkRecognition(segmentation, threeModels(), 1);
  EXPECT_EQ(namesOf(stages), (std::vector<std::string>{"vfh", "icp", "search"}));
  for (const auto& stage : stages) {
    EXPECT_GT(stage.ours.min_ms, 0) << stage.name;
    EXPECT_GT(stage.pcl.min_ms, 0) << stage.name;
  }
}

TEST(BenchmarkRecognition, HasNothingToTimeWhereNothingStands) {
  EXPECT_TRUE(benchmarkRecognition(Segmentation(), threeModels(), 1).empty());
}

TEST(BenchmarkRecognition, TimesAWholeFrameWithOneHypothesisEachAndWithVerifiedOnes) {
  Scene scene;
  scene.name = "three";
  scene.cloud = scene::threeObjects().cloud;
  const auto timing = benchmarkScene(scene, std::nullopt, PipelineOptions(), &threeModels(), 1);
  ASSERT_GE(timing.stages.size(), 2u);
  const auto& frame = timing.stages[timing.stages.size() - 2];
  const auto& verified = timing.stages.back();
  EXPECT_EQ(frame.name, "frame");
  EXPECT_EQ(verified.name, "frame_verified");
  const auto clusters = segmentScene(scene.cloud, std::nullopt, PipelineOptions()).clusters;
  ASSERT_LE(clusters.size(), 5u);
  EXPECT_EQ(frame.stock, "chain for " + std::to_string(clusters.size()) + " clusters");
  EXPECT_EQ(verified.stock, frame.stock);
}

TEST(BenchmarkRecognition, StockNormalsAreThoseThatOursAre) {
  const Cloud cloud = scene::threeObjects().cloud;
  const auto points = pointsAt(cloud, validIndices(cloud));
  const Surface ours = sampleSurface(points, 0.005, 0.015, Eigen::Vector3f::Zero());
  stock::Points::Ptr sampled(new stock::Points);
  for (const auto& p : ours.points) sampled->emplace_back(p.x(), p.y(), p.z(), 0, 0, 0);
  const auto stock = stock::withNormals(sampled, 0.015);
  ASSERT_EQ(stock->size(), ours.size());
  std::size_t alike = 0;
  for (std::size_t i = 0; i < ours.size(); ++i)
    alike += (*stock)[i].getNormalVector3fMap().dot(ours.normals[i]) > 0.999f;
  EXPECT_GT(static_cast<double>(alike), 0.98 * static_cast<double>(ours.size()));
}

TEST(BenchmarkRecognition, StockPointToPointIcpComesNearer) {
  const Surface model = views::surfaceOf(scene::house(), 0.003);
  const Surface source = transformed(model, clouds::motion(3, {1, 2, 1}, {0.003, 0, -0.002}));
  const auto aligned = stock::RegistrationTarget(model).alignToPoints(
      stock::orientedPoints(source), Eigen::Isometry3f::Identity(), 0.02, 20);
  EXPECT_EQ(aligned.iterations, 20);
  const auto offOf = [&](const Eigen::Isometry3f& T) {
    double sum = 0;
    for (std::size_t i = 0; i < source.size(); ++i)
      sum += (T * source.points[i] - model.points[i]).norm();
    return sum / static_cast<double>(source.size());
  };
  EXPECT_LT(offOf(aligned.T_target_source), 0.5 * offOf(Eigen::Isometry3f::Identity()));
}

TEST(BenchmarkRecognition, StockIcpTakesAllItsStepsToThePoseOfOurs) {
  const Surface model = views::surfaceOf(scene::house(), 0.003);
  const Eigen::Isometry3d off = clouds::motion(3, {1, 2, 1}, {0.003, 0, -0.002});
  const Surface source = transformed(model, off);
  const auto stock = stock::RegistrationTarget(model).align(
      stock::orientedPoints(source), Eigen::Isometry3f::Identity(), 0.02, 20);
  EXPECT_EQ(stock.iterations, 20);

  RefineOptions options;
  options.max_iterations = 20;
  options.start_distance = options.max_distance = 0.02;
  options.trim = 1;
  options.min_rotation = options.min_translation = 0;
  const auto ours =
      refinePose(source, NearestGrid(model, 0.002, 0.04), Eigen::Isometry3d::Identity(), options);
  ASSERT_TRUE(ours);
  EXPECT_EQ(ours->iterations, 20);
  const Eigen::Isometry3d between =
      ours->T_camera_object.inverse() * stock.T_target_source.inverse().cast<double>();
  EXPECT_LT(between.translation().norm(), 0.001);
  EXPECT_LT(angleOf(between.linear()), M_PI / 180);
  EXPECT_LT((ours->T_camera_object.translation() - off.translation()).norm(), 0.001);
}

TEST(BenchmarkRecognition, StockSearchFindsTheRowsThatOursFinds) {
  const ModelIndex many = manyVectors(threeModels(), 500);
  const auto& vectors = many.vectors("vfh");
  ASSERT_EQ(vectors.entries.size(), 500u);
  const stock::LinearSearch search(vectors.values, vectors.dimension);
  Descriptor query{"vfh", {}, Eigen::Vector3f::UnitZ(), {}};
  query.values.assign(vectors.values.begin() + 7 * vectors.dimension,
                      vectors.values.begin() + 8 * vectors.dimension);
  query.values[3] += 1;
  MatchOptions options;
  options.max_distance = 1e6;
  std::vector<int> ours;
  for (const auto& neighbor : nearestViews(query, vectors.entries[0].extent, many, options))
    ours.push_back(neighbor.view);
  EXPECT_EQ(ours.front(), 7);
  EXPECT_EQ(search.nearest(query.values, options.neighbors), ours);
}

}  // namespace
}  // namespace tabletop_perception::tools
