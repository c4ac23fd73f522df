#include "tabletop_perception/kd_tree.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"

using namespace tabletop_perception;

namespace {

/// Squared distances of all points from `p`, ascending.
std::vector<float> sortedDistances(const std::vector<Eigen::Vector3f>& points,
                                   const Eigen::Vector3f& p) {
  std::vector<float> distances;
  for (const auto& q : points) distances.push_back((p - q).squaredNorm());
  std::sort(distances.begin(), distances.end());
  return distances;
}

}  // namespace

TEST(KdTree, FindsWhatComparingWithEveryPointFinds) {
  const auto points = clouds::randomPoints(500, 0.5f, 1);
  const KdTree tree(points);
  std::vector<KdTree::Neighbor> found;
  for (const auto& p : clouds::randomPoints(100, 0.7f, 2)) {
    const auto truth = sortedDistances(points, p);
    const auto nearest = tree.nearest(p);
    EXPECT_NEAR(nearest.squared_distance, truth[0], 1e-6);
    EXPECT_NEAR((points[nearest.index] - p).squaredNorm(), truth[0], 1e-6);

    tree.nearest(p, 12, found);
    ASSERT_EQ(found.size(), 12u);
    for (int i = 0; i < 12; ++i) {
      EXPECT_NEAR(found[i].squared_distance, truth[i], 1e-6);
      EXPECT_NEAR((points[found[i].index] - p).squaredNorm(), truth[i], 1e-6);
    }

    tree.within(p, 0.2, found);
    const auto count = std::upper_bound(truth.begin(), truth.end(), 0.04f) - truth.begin();
    EXPECT_EQ(static_cast<std::ptrdiff_t>(found.size()), count);
    for (const auto& neighbor : found)
      EXPECT_LE((points[neighbor.index] - p).squaredNorm(), 0.04f + 1e-6f);
  }
}

TEST(KdTree, GivesNoMorePointsThanItHas) {
  const KdTree tree({{0, 0, 0}, {1, 0, 0}, {1, 0, 0}});
  std::vector<KdTree::Neighbor> found;
  tree.nearest({0.9f, 0, 0}, 10, found);
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[2].index, 0);
}

TEST(KdTree, WithoutPointsFindsNone) {
  const KdTree tree(std::vector<Eigen::Vector3f>{});
  std::vector<KdTree::Neighbor> found{{0, 0}};
  EXPECT_EQ(tree.nearest({0, 0, 0}).index, -1);
  tree.nearest({0, 0, 0}, 3, found);
  EXPECT_TRUE(found.empty());
  tree.within({0, 0, 0}, 1, found);
  EXPECT_TRUE(found.empty());
}

TEST(KdTree, MayBeMoved) {
  KdTree tree({{0, 0, 0}, {1, 0, 0}});
  const KdTree moved(std::move(tree));
  EXPECT_EQ(moved.nearest({0.9f, 0, 0}).index, 1);
  EXPECT_EQ(moved.points().size(), 2u);
}
