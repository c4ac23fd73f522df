#include "tabletop_perception/split.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <vector>

#include <gtest/gtest.h>

#include "scene.h"
#include "tabletop_perception/cluster.h"

using namespace tabletop_perception;

namespace {

/// The points of the scene's objects, and them as one cluster where they touch.
struct Touching {
  scene::SyntheticScene scene;
  Cloud cloud;
  std::vector<Indices> clusters;
};

Touching touching(const std::vector<scene::Standing>& items) {
  Touching result;
  scene::SceneOptions options;
  options.noise = 0.001;
  result.scene = scene::render(items, options);
  Indices standing;
  for (std::size_t i = 0; i < result.scene.truth.size(); ++i)
    if (result.scene.truth[i] >= 2) standing.push_back(static_cast<int>(i));
  result.cloud = keepPoints(result.scene.cloud, standing);
  result.clusters = extractClusters(result.cloud, ClusterOptions());
  return result;
}

Eigen::Isometry3d lifted(Eigen::Isometry3d T, double height) {
  T.translation().z() += height;
  return T;
}

/// A tall box on the middle of a wide one.
Touching stack() {
  return touching(
      {{"wide", scene::box(0.20, 0.20, 0.06), scene::standing(0, 0, 0.3)},
       {"tall", scene::box(0.07, 0.07, 0.15), lifted(scene::standing(0, 0, 0.3), 0.06)}});
}

/// Share of a part's points that belong to the object that most of them belong to.
double purity(const Indices& part, const std::vector<std::uint32_t>& truth) {
  std::map<std::uint32_t, int> counts;
  for (const int i : part) ++counts[truth[i]];
  int most = 0;
  for (const auto& [label, count] : counts) most = std::max(most, count);
  return static_cast<double>(most) / static_cast<double>(part.size());
}

}  // namespace

TEST(Split, ABoxOnABoxAreTwoThings) {
  const auto stacked = stack();
  ASSERT_EQ(stacked.clusters.size(), 1u) << "they are meant to touch";
  const auto parts = splitClusters(stacked.cloud, stacked.clusters, SplitOptions());
  ASSERT_EQ(parts.size(), 2u);
  for (const auto& part : parts) EXPECT_GT(purity(part, stacked.scene.truth), 0.97);
  std::size_t points = 0;
  for (const auto& part : parts) points += part.size();
  EXPECT_GT(points, 0.98 * stacked.clusters[0].size());
  EXPECT_GE(parts[0].size(), parts[1].size());
  for (const auto& part : parts) EXPECT_TRUE(std::is_sorted(part.begin(), part.end()));
}

TEST(Split, AConvexThingStaysWhole) {
  for (const double turn : {0.0, 0.4, 0.8}) {
    const auto one = touching({{"box", scene::box(0.08, 0.12, 0.15), scene::standing(0, 0, turn)}});
    ASSERT_EQ(one.clusters.size(), 1u);
    EXPECT_EQ(splitClusters(one.cloud, one.clusters, SplitOptions()).size(), 1u) << turn;
  }
  const auto can = touching({{"can", scene::cylinder(0.04, 0.12), scene::standing(0, 0, 0)}});
  EXPECT_EQ(splitClusters(can.cloud, can.clusters, SplitOptions()).size(), 1u);
}

TEST(Split, SwitchedOffOrWithoutAGridClustersStayAsTheyAre) {
  const auto stacked = stack();
  SplitOptions off;
  off.enabled = false;
  EXPECT_EQ(splitClusters(stacked.cloud, stacked.clusters, off), stacked.clusters);

  const Cloud packed = selectPoints(stacked.cloud, stacked.clusters[0]);
  const std::vector<Indices> all{validIndices(packed)};
  EXPECT_EQ(splitClusters(packed, all, SplitOptions()), all);
  EXPECT_TRUE(splitClusters(stacked.cloud, {}, SplitOptions()).empty());
}

TEST(Split, PartsOfDifferentClustersAreNeverJoined) {
  const auto stacked = stack();
  std::vector<Indices> halves(2);
  for (const int i : stacked.clusters[0])
    halves[i % stacked.cloud.width < stacked.cloud.width / 2].push_back(i);
  for (const auto& part : splitClusters(stacked.cloud, halves, SplitOptions())) {
    const bool left = part.front() % stacked.cloud.width < stacked.cloud.width / 2;
    for (const int i : part) ASSERT_EQ(i % stacked.cloud.width < stacked.cloud.width / 2, left);
  }
}

TEST(Split, TheMirrorImageIsCutTheSameWay) {
  const auto stacked = stack();
  const int width = stacked.cloud.width;
  const auto mirrored = [&](int i) { return i / width * width + width - 1 - i % width; };
  Cloud mirror(width, stacked.cloud.height, false);
  for (const int i : validIndices(stacked.cloud)) {
    const Eigen::Vector3f p = stacked.cloud.point(i);
    mirror.setPoint(mirrored(i), {-p.x(), p.y(), p.z()});
  }
  const auto parts = splitClusters(stacked.cloud, stacked.clusters, SplitOptions());
  const auto other =
      splitClusters(mirror, extractClusters(mirror, ClusterOptions()), SplitOptions());
  ASSERT_EQ(other.size(), parts.size());
  for (std::size_t k = 0; k < parts.size(); ++k)
    EXPECT_NEAR(static_cast<double>(other[k].size()), parts[k].size(), 0.02 * parts[k].size());
}

TEST(Split, OptionsOutOfRangeAreRefused) {
  SplitOptions options;
  options.gap = -1;
  EXPECT_THROW(splitClusters(Cloud(), {}, options), std::invalid_argument);
}
