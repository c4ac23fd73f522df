#include "tabletop_perception/nearest_grid.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "tabletop_perception/kd_tree.h"

using namespace tabletop_perception;

namespace {

constexpr double CELL = 0.004, MARGIN = 0.03;

Surface randomSurface() {
  Surface surface;
  surface.points = clouds::randomPoints(300, 0.05f, 3);
  surface.normals.assign(300, Eigen::Vector3f::UnitZ());
  return surface;
}

}  // namespace

TEST(NearestGrid, IsExactToWithinTheCubesDiagonal) {
  const Surface surface = randomSurface();
  const NearestGrid grid(surface, CELL, MARGIN);
  const KdTree tree(surface.points);
  for (const auto& p : clouds::randomPoints(2000, 0.07f, 4)) {
    const int nearest = grid.nearest(p);
    ASSERT_GE(nearest, 0) << p.transpose();
    const double found = (surface.points[nearest] - p).norm();
    const double truth = std::sqrt(tree.nearest(p).squared_distance);
    // Both p and the other point may be half a diagonal off the cube's centre.
    EXPECT_LE(found, truth + std::sqrt(3.0) * CELL);
  }
}

TEST(NearestGrid, KnowsNothingBeyondItsMargin) {
  const Surface one{{{0.1f, 0.2f, 0.3f}}, {{0, 0, 1}}};
  const NearestGrid grid(one, CELL, MARGIN);
  for (int axis = 0; axis < 3; ++axis)
    for (const float sign : {-1.0f, 1.0f}) {
      const auto at = [&](double distance) {
        Eigen::Vector3f p = one.points[0];
        p[axis] += sign * static_cast<float>(distance);
        return grid.nearest(p);
      };
      EXPECT_EQ(at(0), 0);
      EXPECT_EQ(at(MARGIN - 0.001), 0);
      EXPECT_EQ(at(MARGIN + 1.01 * CELL), -1);
      EXPECT_EQ(at(10), -1);
    }
}

TEST(NearestGrid, WithoutPointsIsRefused) {
  EXPECT_EQ(clouds::refusalOf([] { NearestGrid({}, CELL, MARGIN); }),
            "nearest grid: the surface has no points");
  EXPECT_EQ(NearestGrid().nearest({0, 0, 0}), -1);
}
