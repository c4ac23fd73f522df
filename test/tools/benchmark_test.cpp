#include "benchmark_stages.h"

#include <gtest/gtest.h>

#include <chrono>
#include <set>
#include <thread>

#include "scene.h"

namespace tabletop_perception::tools {
namespace {

void sleepFor(int milliseconds) {
  std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
}

TEST(Benchmark, RunsTheTwoSidesInTurn) {
  std::string order;
  const auto stage = timeInTurn(
      "any", "any", 3, [&] { order += 'o'; },
      [&] {
        order += 's';
        sleepFor(2);
      });
  EXPECT_EQ(order, "osososos");  // once to warm up
  EXPECT_EQ(stage.ours.runs, 3);
  EXPECT_EQ(stage.pcl.runs, 3);
  EXPECT_GE(stage.pcl.min_ms, 2);
  EXPECT_LE(stage.pcl.min_ms, stage.pcl.median_ms);
  EXPECT_GT(stage.ratio(), 1);
}

TEST(Benchmark, RunsASlowOpponentLessOften) {
  int ours = 0, stock = 0;
  const auto stage = timeInTurn(
      "any", "any", 20, [&] { ++ours; },
      [&] {
        ++stock;
        sleepFor(310);
      });
  EXPECT_EQ(stage.ours.runs, 20);
  EXPECT_EQ(stage.pcl.runs, 5);
  EXPECT_EQ(ours, 20 + 1);  // and one to warm up
  EXPECT_EQ(stock, 5 + 1);
}

std::set<std::string> namesOf(const SceneTiming& timing) {
  std::set<std::string> names;
  for (const auto& stage : timing.stages) names.insert(stage.name);
  return names;
}

SceneTiming benchmarkOf(const Cloud& cloud) {
  Scene scene;
  scene.name = "three";
  scene.cloud = cloud;
  return benchmarkScene(scene, std::nullopt, PipelineOptions(), nullptr, 1);
}

TEST(Benchmark, LeavesOutWhatNeedsAGridInAnUnorganisedCloud) {
  const Cloud grid = scene::threeObjects().cloud;
  const auto timing = benchmarkOf(selectPoints(grid, validIndices(grid)));
  EXPECT_EQ(namesOf(timing),
            (std::set<std::string>{"crop", "voxel_grid", "plane", "clusters", "front_end"}));
  EXPECT_FALSE(timing.our_normals);
}

TEST(Benchmark, SaysWhyStagesAreMissing) {
  const auto timing = benchmarkOf(Cloud(64, 48, true));
  EXPECT_EQ(namesOf(timing), (std::set<std::string>{"crop", "voxel_grid", "normals"}));
  EXPECT_EQ(timing.reason, "the cloud has no valid point");
}

TEST(Benchmark, ComparesTheMethodsForNormals) {
  const auto timing = benchmarkOf(scene::threeObjects().cloud);
  ASSERT_EQ(timing.normals_methods.size(), 4u);
  EXPECT_EQ(timing.normals_methods[0].method, "window");
  EXPECT_FALSE(timing.normals_methods[0].pcl);
  for (const auto& entry : timing.normals_methods) {
    SCOPED_TRACE(entry.method);
    EXPECT_GT(entry.ours.min_ms, 0);
    EXPECT_GT(entry.our_quality.valid_share, 0.9);
    EXPECT_LT(entry.our_quality.median_error_deg, 1);
    EXPECT_LE(entry.our_quality.median_error_deg, entry.our_quality.p95_error_deg);
    EXPECT_EQ(entry.pcl.has_value(), entry.method != "window");
    EXPECT_EQ(entry.pcl_quality.has_value(), entry.pcl.has_value());
  }
}

TEST(Benchmark, RatesNormalsOnTheTable) {
  const auto timing = benchmarkOf(scene::threeObjects().cloud);
  ASSERT_TRUE(timing.our_normals && timing.pcl_normals);
  EXPECT_GT(timing.our_normals->valid_share, 0.97);
  EXPECT_LT(timing.our_normals->p95_error_deg, 5);
  EXPECT_LE(timing.pcl_normals->valid_share, 1);
  EXPECT_GT(timing.pcl_normals->p95_error_deg, 0);
}

}  // namespace
}  // namespace tabletop_perception::tools
