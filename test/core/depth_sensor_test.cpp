#include "tabletop_perception/depth_sensor.h"

#include <gtest/gtest.h>

#include <cmath>

#include "scene.h"

namespace tabletop_perception {
namespace {

constexpr Projection CAMERA{525, 525, 319.5, 239.5, 640, 480, 1};

/// A wall across the view at a depth [m].
Cloud wall(double z) {
  Cloud cloud(CAMERA.width, CAMERA.height, false);
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
    const Eigen::Vector3d ray((i % 640 - CAMERA.cx) / CAMERA.fx, (i / 640 - CAMERA.cy) / CAMERA.fy,
                              1);
    cloud.setPoint(i, (z * ray).cast<float>());
  }
  return cloud;
}

TEST(AxialNoise, IsTheOneOfNguyenAndOthers) {
  EXPECT_DOUBLE_EQ(axialNoise(0.4), 0.0012);
  EXPECT_NEAR(axialNoise(1.4), 0.0031, 1e-12);
}

class SensedWall : public testing::TestWithParam<double> {};

TEST_P(SensedWall, HasTheNoiseOfTheFormulaAndOfTheQuantisation) {
  const double z = GetParam();
  Random random(3);
  const Cloud ideal = wall(z);
  const Cloud sensed = senseDepth(ideal, ideal, CAMERA, {}, random);
  double sum = 0, squares = 0;
  int count = 0;
  for (int row = 100; row < 380; ++row)  // away from grazing angles and the border
    for (int column = 150; column < 490; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * 640 + column;
      ASSERT_TRUE(sensed.valid(i));
      sum += sensed.z[i] - z;
      squares += (sensed.z[i] - z) * (sensed.z[i] - z);
      ++count;
    }
  const double mean = sum / count, deviation = std::sqrt(squares / count - mean * mean);
  const double step = z * z / (525 * 0.075) / 8;
  EXPECT_NEAR(mean, 0, step / 4);
  EXPECT_NEAR(deviation, std::hypot(axialNoise(z), step / std::sqrt(12)), 0.05 * deviation);
}

INSTANTIATE_TEST_SUITE_P(Depths, SensedWall, testing::Values(0.6, 1.0, 1.6, 2.5));

TEST(SenseDepth, DisparitiesAreWholeEighthsAndPointsStayOnTheirRays) {
  Random random(4);
  const Cloud ideal = wall(1.1);
  const Cloud sensed = senseDepth(ideal, ideal, CAMERA, {}, random);
  for (const int i : validIndices(sensed)) {
    const double steps = 8 * 525 * 0.075 / sensed.z[i];
    ASSERT_NEAR(steps, std::round(steps), 1e-3);
    ASSERT_NEAR(CAMERA.pixel(sensed.point(i).cast<double>()).x(), i % 640, 1e-3);
    ASSERT_NEAR(CAMERA.pixel(sensed.point(i).cast<double>()).y(), i / 640, 1e-3);
  }
}

TEST(SenseDepth, WhatIsOutOfRangeHasNoDepth) {
  Random random(5);
  for (const double z : {0.3, 6.0}) {
    const Cloud ideal = wall(z);
    EXPECT_TRUE(validIndices(senseDepth(ideal, ideal, CAMERA, {}, random)).empty()) << z;
  }
}

/// A plate, 20 cm wide at 0.8 m, before a wall at 1.2 m; the projector to the camera's right.
struct PlateBeforeWall {
  PlateBeforeWall() {
    const auto plate = scene::moved(scene::box(0.2, 3, 0.001), 0, 0, 0.8);
    const auto back = scene::moved(scene::box(4, 4, 0.001), 0, 0, 1.2);
    const MeshRenderer both(scene::merged({plate, back}));
    ideal = both.render(Eigen::Isometry3d::Identity(), CAMERA);
    projected = both.render(projectorPose({}), CAMERA);
  }
  Cloud ideal, projected;
};

TEST(SenseDepth, NoDepthInTheProjectorsShadow) {
  const PlateBeforeWall scene;
  Random random(6);
  const Cloud sensed = senseDepth(scene.ideal, scene.projected, CAMERA, {}, random);
  // The shadow's edge: from (0.075, 0) past (-0.1, 0.8) to the wall. The plate ends at -0.15 for
  // the camera; to its right nothing is in the shadow.
  const double edge = 0.075 + (-0.1 - 0.075) * 1.2 / 0.8;
  int shadow = 0, lit = 0;
  for (std::size_t i = 0; i < sensed.size(); ++i) {
    const float x = scene.ideal.x[i];
    if (std::abs(scene.ideal.z[i] - 1.2f) > 0.01f || std::abs(x) < 0.16) continue;
    const bool in_shadow = x < 0 && x > edge;
    if (std::abs(x - edge) < 0.01) continue;
    ASSERT_EQ(sensed.valid(i), !in_shadow) << x;
    ++(in_shadow ? shadow : lit);
  }
  EXPECT_GT(shadow, 480 * 5);
  EXPECT_GT(lit, 480 * 100);
}

TEST(SenseDepth, OutlinesLosePointsAndMoveByAPixelAtMost) {
  const PlateBeforeWall scene;
  Random random(7);
  const Cloud sensed = senseDepth(scene.ideal, scene.projected, CAMERA, {}, random);
  int lost = 0, beside = 0, moved = 0;
  for (int row = 0; row < 480; ++row)
    for (int column = 330; column < 630; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * 640 + column;
      const float z = scene.ideal.z[i];
      if (std::abs(scene.ideal.z[i - 1] - scene.ideal.z[i + 1]) > 0.1f) {
        ++beside;
        lost += !sensed.valid(i);
        moved += sensed.valid(i) && std::abs(sensed.z[i] - z) > 0.1f;
      } else if (sensed.valid(i)) {
        ASSERT_NEAR(sensed.z[i], z, 0.02);
      }
    }
  EXPECT_NEAR(static_cast<double>(lost) / beside, DepthSensor().edge_dropout, 0.06);
  EXPECT_GT(moved, beside / 20);
}

TEST(SenseDepth, GrazingSurfacesLosePoints) {
  // A floor 0.2 m below the camera: beyond 1.2 m it is seen at more than 80 degrees.
  const MeshRenderer floor(scene::moved(scene::box(6, 0.001, 6), 0, 0.2, 0));
  const Cloud ideal = floor.render(Eigen::Isometry3d::Identity(), CAMERA);
  Random random(8);
  const Cloud sensed = senseDepth(ideal, ideal, CAMERA, {}, random);
  int near = 0, near_kept = 0, far = 0, far_kept = 0;
  for (const int i : validIndices(ideal)) {
    const double angle = std::atan2(ideal.z[i], 0.2) * 180 / M_PI;
    if (std::abs(ideal.x[i]) > 0.05) continue;
    if (angle < 69) ++near, near_kept += sensed.valid(i);
    if (angle > 86) ++far, far_kept += sensed.valid(i);
  }
  ASSERT_GT(near, 100);
  ASSERT_GT(far, 100);
  EXPECT_GT(near_kept, 0.95 * near);
  EXPECT_EQ(far_kept, 0);
}

}  // namespace
}  // namespace tabletop_perception
