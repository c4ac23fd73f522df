#include "tabletop_perception/cluster.h"

#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"

using namespace tabletop_perception;
using clouds::refusalOf;

namespace {

constexpr float SPACING = 0.002f;  // of the grids below [m]

ClusterOptions withTolerance(double tolerance, int min_points = 1) {
  ClusterOptions options;
  options.tolerance = tolerance;
  options.noise_gap = 0;
  options.min_points = min_points;
  return options;
}

/// A wall one metre away, seen straight on: points SPACING apart.
Cloud wall(int width, int height) {
  Cloud cloud(width, height, false);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      cloud.setPoint(static_cast<std::size_t>(v) * width + u, {SPACING * u, SPACING * v, 1});
  return cloud;
}

void dropColumns(Cloud& cloud, int first, int last) {
  for (int v = 0; v < cloud.height; ++v)
    for (int u = first; u <= last; ++u) cloud.drop(static_cast<std::size_t>(v) * cloud.width + u);
}

/// Single linkage by comparing every point with every other; in the order of extractClusters.
std::vector<Indices> singleLinkage(const Cloud& cloud, double tolerance, double noise_gap = 0) {
  const auto gapAt = [&](int i) {
    return std::max(tolerance, noise_gap * cloud.point(i).cast<double>().squaredNorm());
  };
  std::vector<Indices> clusters;
  std::vector<bool> taken(cloud.size(), false);
  for (const int seed : validIndices(cloud)) {
    if (taken[seed]) continue;
    Indices cluster{seed};
    taken[seed] = true;
    for (std::size_t next = 0; next < cluster.size(); ++next)
      for (const int j : validIndices(cloud))
        if (!taken[j] && (cloud.point(cluster[next]) - cloud.point(j)).norm() <=
                             std::max(gapAt(cluster[next]), gapAt(j))) {
          taken[j] = true;
          cluster.push_back(j);
        }
    std::sort(cluster.begin(), cluster.end());
    clusters.push_back(std::move(cluster));
  }
  std::stable_sort(clusters.begin(), clusters.end(),
                   [](const Indices& a, const Indices& b) { return a.size() > b.size(); });
  return clusters;
}

}  // namespace

TEST(Cluster, TwoPiecesFartherApartThanTheToleranceAreTwo) {
  Cloud cloud = wall(40, 20);
  dropColumns(cloud, 15, 20);  // 14 mm from point to point
  const auto clusters = extractClusters(cloud, withTolerance(0.013));
  ASSERT_EQ(clusters.size(), 2u);
  EXPECT_EQ(clusters[0].size(), 19u * 20u);
  EXPECT_EQ(clusters[1].size(), 15u * 20u);
  EXPECT_EQ(clusters[1].front(), 0);
}

TEST(Cluster, AGapWithinTheToleranceIsBridgedAcrossPixelsWithoutDepth) {
  Cloud cloud = wall(40, 20);
  dropColumns(cloud, 15, 20);
  EXPECT_EQ(extractClusters(cloud, withTolerance(0.015)).size(), 1u);
}

TEST(Cluster, GapsAreMetresNotPixels) {
  Cloud cloud = wall(40, 20);
  dropColumns(cloud, 15, 20);
  for (auto* axis : {&cloud.x, &cloud.y, &cloud.z})
    for (float& value : *axis) value *= 2;  // twice as far away, 28 mm between the pieces
  EXPECT_EQ(extractClusters(cloud, withTolerance(0.015)).size(), 2u);
}

TEST(Cluster, AStepInDepthPartsNeighbouringPixels) {
  Cloud cloud = wall(40, 20);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (i % 40 >= 25) cloud.z[i] += 0.02f;
  const auto clusters = extractClusters(cloud, withTolerance(0.015));
  ASSERT_EQ(clusters.size(), 2u);
  for (const int i : clusters[0]) EXPECT_LT(i % 40, 25);
}

TEST(Cluster, WhatPassesInFrontDoesNotJoinWhatItHides) {
  Cloud cloud = wall(40, 20);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (i % 40 >= 18 && i % 40 < 22) cloud.setPoint(i, 0.5f * cloud.point(i));
  const auto clusters = extractClusters(cloud, withTolerance(0.005));
  ASSERT_EQ(clusters.size(), 3u);
  EXPECT_EQ(clusters[2].size(), 4u * 20u);
}

TEST(Cluster, AreSortedBySizeThenByFirstPointAndAscendWithin) {
  Cloud cloud = wall(50, 10);
  dropColumns(cloud, 10, 19);  // 10 columns
  dropColumns(cloud, 30, 34);  // 10 and 15 columns
  const auto clusters = extractClusters(cloud, withTolerance(0.003));
  ASSERT_EQ(clusters.size(), 3u);
  EXPECT_EQ(clusters[0].front(), 35);
  EXPECT_EQ(clusters[1].front(), 0);
  EXPECT_EQ(clusters[2].front(), 20);
  for (const auto& cluster : clusters) EXPECT_TRUE(std::is_sorted(cluster.begin(), cluster.end()));
}

TEST(Cluster, SizesOutsideTheLimitsAreDropped) {
  Cloud cloud = wall(50, 10);
  dropColumns(cloud, 10, 19);
  dropColumns(cloud, 35, 39);  // leaves 100, 150 and 100 points
  for (const Cloud& any : {cloud, clouds::unorganised(cloud)}) {
    auto options = withTolerance(0.003, 101);
    ASSERT_EQ(extractClusters(any, options).size(), 1u);
    options.min_points = 100;
    EXPECT_EQ(extractClusters(any, options).size(), 3u);
    options.max_points = 149;
    EXPECT_EQ(extractClusters(any, options).size(), 2u);
    options.max_points = 150;
    EXPECT_EQ(extractClusters(any, options).size(), 3u);
  }
}

TEST(Cluster, NothingInNothingOut) {
  EXPECT_TRUE(extractClusters(Cloud(), withTolerance(0.01)).empty());
  EXPECT_TRUE(extractClusters(Cloud(8, 6, false), withTolerance(0.01)).empty());
  EXPECT_TRUE(extractClusters(Cloud(48, 1, false), withTolerance(0.01)).empty());
}

TEST(Cluster, AnObjectOfWhichANarrowStripIsHiddenIsOne) {
  Cloud cloud = wall(40, 20);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (i % 40 >= 18 && i % 40 < 22) cloud.setPoint(i, 0.5f * cloud.point(i));
  const auto clusters = extractClusters(cloud, withTolerance(0.011));  // 10 mm are hidden
  ASSERT_EQ(clusters.size(), 2u);
  EXPECT_EQ(clusters[0].size(), 36u * 20u);
  EXPECT_EQ(clusters[1].size(), 4u * 20u);
}

TEST(Cluster, OverTheGridIsSingleLinkage) {
  std::mt19937 random(4);
  for (int round = 0; round < 30; ++round) {
    Cloud cloud(12, 10, false);
    const auto points = clouds::randomPoints(120, 0.1f, round + 1);
    for (std::size_t i = 0; i < cloud.size(); ++i)
      if (random() % 5 != 0) cloud.setPoint(i, points[i]);
    const double tolerance = 0.02 + 0.001 * round;
    const auto clusters = extractClusters(cloud, withTolerance(tolerance));
    EXPECT_EQ(clusters, singleLinkage(cloud, tolerance)) << "round " << round;
  }
}

TEST(Cluster, OverTheGridIsSingleLinkageOnWallsWithHoles) {
  std::mt19937 random(3);
  for (int round = 0; round < 30; ++round) {
    Cloud cloud = wall(16, 12);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const unsigned what = random() % 10;
      if (what < 3) cloud.drop(i);
      if (what > 7) cloud.z[i] += 0.1f;  // on another wall
    }
    const double tolerance = (1.2 + 0.05 * round) * SPACING;
    EXPECT_EQ(extractClusters(cloud, withTolerance(tolerance)), singleLinkage(cloud, tolerance))
        << "round " << round;
    ClusterOptions noisy = withTolerance(tolerance);
    noisy.noise_gap = 0.012;
    EXPECT_EQ(extractClusters(cloud, noisy), singleLinkage(cloud, tolerance, noisy.noise_gap))
        << "round " << round;
  }
}

TEST(Cluster, WithoutTheGridAreTheSameAsOnIt) {
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, 0.4f * SPACING);
  for (int round = 0; round < 20; ++round) {
    Cloud cloud = wall(60, 40);
    for (const int i : validIndices(cloud)) {
      const unsigned what = random() % 10;
      cloud.setPoint(i, cloud.point(i) + Eigen::Vector3f(noise(random), noise(random), 0));
      if (what < 5) cloud.drop(i);
      if (what > 7) cloud.z[i] += 0.02f;  // on another wall
    }
    const auto options = withTolerance((1.1 + 0.1 * round) * SPACING);
    const auto clusters = extractClusters(cloud, options);
    EXPECT_EQ(extractClusters(clouds::unorganised(cloud), options), clusters) << "round " << round;
    EXPECT_GT(clusters.size(), 1u);
  }
}

TEST(Cluster, WithoutTheGridNearIsNearInEveryDirection) {
  // Pairs in every direction, some a hair nearer than the tolerance, the others a hair farther.
  constexpr double TOLERANCE = 0.01;
  for (const auto& direction : clouds::randomPoints(500, 1, 9)) {
    const Eigen::Vector3f end = direction.normalized() * static_cast<float>(TOLERANCE);
    for (const auto& start : {Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(0.123f, -0.07f, 0.2f)}) {
      const Cloud near = clouds::cloudOf({start, start + 0.999f * end});
      const Cloud far = clouds::cloudOf({start, start + 1.001f * end});
      ASSERT_EQ(extractClusters(near, withTolerance(TOLERANCE)).size(), 1u) << end.transpose();
      ASSERT_EQ(extractClusters(far, withTolerance(TOLERANCE)).size(), 2u) << end.transpose();
    }
  }
}

TEST(Cluster, UnorganisedIsSingleLinkage) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Cloud cloud = clouds::cloudOf(clouds::randomPoints(150, 0.1f, seed));
    for (std::size_t i = 0; i < cloud.size(); i += 9) cloud.drop(i);
    const double tolerance = 0.025;
    const auto clusters = extractClusters(cloud, withTolerance(tolerance));
    EXPECT_EQ(clusters, singleLinkage(cloud, tolerance)) << "seed " << seed;
    EXPECT_GT(clusters.size(), 3u);
    EXPECT_GT(clusters.front().size(), 1u);
  }
}

TEST(Cluster, LabelsAndClustersSayTheSame) {
  const std::vector<Indices> clusters{{1, 4, 5}, {0, 7}};
  const auto labels = labelsOf(9, {2, 3}, clusters);
  EXPECT_EQ(labels, (std::vector<std::uint32_t>{3, 2, 1, 1, 2, 2, 0, 3, 0}));
  EXPECT_EQ(clustersOf(labels), clusters);
}

TEST(Cluster, ALabelThatNoPointHasIsAnEmptyCluster) {
  EXPECT_EQ(clustersOf({0, 4, 1, 2, 4}), (std::vector<Indices>{{3}, {}, {1, 4}}));
  EXPECT_TRUE(clustersOf({}).empty());
  EXPECT_TRUE(clustersOf({0, 1, 1}).empty());
}

TEST(Cluster, AnAbsurdLabelIsRefused) {
  EXPECT_EQ(refusalOf([] {
              clustersOf({0, 4294967295u, 2});
            }),
            "label 4294967295 at point 1: more clusters than points");
}

TEST(Cluster, OptionsOutOfRangeAreRefused) {
  EXPECT_EQ(refusalOf([] { extractClusters(Cloud(), withTolerance(0)); }),
            "cluster.tolerance must be between 0.001 and 0.2, got 0");
}
