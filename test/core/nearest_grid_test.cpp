#include "tabletop_perception/nearest_grid.h"

#include <cmath>
#include <limits>
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

TEST(NearestGrid, ABlockCorrespondsPointByPoint) {
  Surface surface = randomSurface();
  for (std::size_t i = 0; i < surface.size(); i += 2) surface.normals[i] = Eigen::Vector3f::UnitX();
  const NearestGrid grid(surface, CELL, MARGIN);
  const Eigen::Isometry3f T = clouds::motion(30, {1, 2, 3}, {0.01, 0, -0.01}).cast<float>();
  constexpr float FARTHEST = 0.02f;
  Surface points;
  points.points = clouds::randomPoints(45, 0.06f, 5);  // most of them beyond the limit
  points.normals.assign(45, Eigen::Vector3f::UnitZ());
  points.points[7].y() = clouds::NO_POINT;
  const PlanarSurface planar(points);
  ASSERT_EQ(planar.blocks.size(), 2u);
  int found[2] = {};
  for (const bool any_facing : {false, true})
    for (std::size_t i = 0; i < 2 * PlanarBlock::SIZE; ++i) {
      const float least = any_facing ? 0 : 0.5f;
      Correspondences block;
      grid.correspond(planar.blocks[i / PlanarBlock::SIZE], T, FARTHEST * FARTHEST, block, least);
      const int lane = static_cast<int>(i % PlanarBlock::SIZE);
      int nearest = -1;
      const bool is_point = i < points.size() && i != 7;
      const Eigen::Vector3f p = is_point ? T * points.points[i] : Eigen::Vector3f::Zero();
      if (is_point) nearest = grid.nearest(p);
      const bool corresponds =
          nearest >= 0 && (surface.points[nearest] - p).norm() <= FARTHEST &&
          std::abs((T.linear() * points.normals[i]).dot(surface.normals[nearest])) >= least;
      found[any_facing] += corresponds;
      if (!corresponds) {
        EXPECT_EQ(block.squared[lane], std::numeric_limits<float>::infinity()) << i;
        continue;
      }
      const Eigen::Vector3f way(block.dx[lane], block.dy[lane], block.dz[lane]);
      const Eigen::Vector3f normal(block.nx[lane], block.ny[lane], block.nz[lane]);
      EXPECT_NEAR(block.squared[lane], (surface.points[nearest] - p).squaredNorm(), 1e-9) << i;
      EXPECT_LT((p + way - surface.points[nearest]).norm(), 1e-6f) << i;
      EXPECT_EQ(normal, surface.normals[nearest]) << i;
    }
  EXPECT_GT(found[0], 5);
  EXPECT_GT(found[1], found[0]);
}

TEST(NearestGrid, AThingOfMetresGetsLargerCubes) {
  Surface corners;
  for (const float x : {0.0f, 20.0f})
    for (const float y : {0.0f, 15.0f})
      for (const float z : {0.0f, 10.0f}) corners.points.emplace_back(x, y, z);
  corners.normals.assign(corners.points.size(), Eigen::Vector3f::UnitZ());
  const NearestGrid grid(corners, CELL, MARGIN);
  EXPECT_LT(grid.memory(), 10e6);
  for (std::size_t i = 0; i < corners.size(); ++i)
    EXPECT_EQ(grid.nearest(corners.points[i]), static_cast<int>(i));
}

TEST(NearestGrid, WithoutPointsIsRefused) {
  EXPECT_EQ(clouds::refusalOf([] { NearestGrid({}, CELL, MARGIN); }),
            "nearest grid: the surface has no points");
  EXPECT_EQ(NearestGrid().nearest({0, 0, 0}), -1);
}
