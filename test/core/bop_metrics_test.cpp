#include "tabletop_perception/bop_metrics.h"

#include <gtest/gtest.h>

#include "scene.h"

namespace tabletop_perception {
namespace {

constexpr Projection CAMERA{525, 525, 319.5, 239.5, 640, 480, 1};

class BopMetrics : public testing::Test {
 protected:
  static Eigen::Isometry3d at(double x, double z) {
    return Eigen::Isometry3d(Eigen::Translation3d(x, 0, z));
  }
  BopError errorOf(const Eigen::Isometry3d& estimate, const Cloud& scene) const {
    return measureBop(model, renderer, scene, CAMERA, at(0, 0.8), estimate);
  }

  Mesh mesh = scene::box(0.1, 0.1, 0.05);  // its far side is 5 cm behind the near one
  ReferenceModel model = makeReferenceModel(mesh, "none");  // a diameter of 15 cm
  MeshRenderer renderer{mesh};
  Cloud scene = renderer.render(at(0, 0.8), CAMERA);
};

TEST_F(BopMetrics, TheTruePoseHasNoErrorAndFullRecall) {
  const auto error = errorOf(at(0, 0.8), scene);
  EXPECT_NEAR(error.mssd, 0, 1e-9);
  EXPECT_NEAR(error.mspd, 0, 1e-9);
  for (const double vsd : error.vsd) EXPECT_EQ(vsd, 0);
  EXPECT_DOUBLE_EQ(bopRecall(error, model.diameter).average(), 1);
}

TEST_F(BopMetrics, AShiftAcrossTheViewIsMeasuredInPixels) {
  const auto error = errorOf(at(0.04, 0.8), scene);
  EXPECT_NEAR(error.mssd, 0.04, 1e-9);
  EXPECT_NEAR(error.mspd, 0.04 * 525 / 0.8, 1e-6);
  // Of 14 cm of width that either covers, 4 cm on each side are covered by one alone.
  EXPECT_NEAR(error.vsd[9], 8.0 / 14, 0.02);
  const auto recall = bopRecall(error, model.diameter);
  EXPECT_DOUBLE_EQ(recall.mspd, 0.5);  // 26.25 pixels
  EXPECT_DOUBLE_EQ(recall.mssd, 0.5);  // 26.7 % of the diameter
  EXPECT_DOUBLE_EQ(recall.vsd, 0);
}

TEST_F(BopMetrics, AShiftInDepthCountsUpToTheTolerance) {
  const auto error = errorOf(at(0, 0.83), scene);  // 20 % of the diameter
  EXPECT_GT(error.vsd[2], 0.95);                   // 15 %
  EXPECT_LT(error.vsd[4], 0.15);                   // 25 %: but for the rim
}

TEST_F(BopMetrics, WhatIsHiddenDoesNotCount) {
  Cloud half = scene;  // the left half of the object behind a wall
  for (std::size_t i = 0; i < half.size(); ++i)
    if (i % 640 < 320) half.setPoint(i, {0, 0, 0.4f});
  const auto hidden = errorOf(at(0.04, 0.8), half);
  // The right half: 5 cm of the truth, 9 cm of either.
  EXPECT_NEAR(hidden.vsd[9], 4.0 / 9, 0.03);
}

TEST_F(BopMetrics, ASymmetricTurnIsNoError) {
  const auto turned = at(0, 0.8) * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ());
  const auto error =
      measureBop(makeReferenceModel(mesh, "half z"), renderer, scene, CAMERA, at(0, 0.8), turned);
  EXPECT_NEAR(error.mspd, 0, 1e-6);
}

TEST(MeanRecall, CountsMissingObjectsAsNothing) {
  EXPECT_FALSE(meanRecall({}));
  const auto mean = meanRecall({BopRecall{1, 0.5, 0.6}, std::nullopt});
  EXPECT_DOUBLE_EQ(mean->vsd, 0.5);
  EXPECT_DOUBLE_EQ(mean->mssd, 0.25);
  EXPECT_DOUBLE_EQ(mean->mspd, 0.3);
}

}  // namespace
}  // namespace tabletop_perception
