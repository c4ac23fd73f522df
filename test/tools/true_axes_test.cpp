#include "true_axes.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace tabletop_perception::tools {
namespace {

using Points = std::vector<Eigen::Vector3f>;

/// Adds a rectangle at z = 1 m about x and y = 0 that is turned about the x axis through its edge
/// y = 0, one point per millimetre, with a noise of 1 mm.
void addFace(Points& points, double width, double height, double turn, std::mt19937& random) {
  std::normal_distribution<double> noise(0, 0.001);
  for (double x = 0; x < width; x += 0.001)
    for (double y = 0; y < height; y += 0.001) {
      const double off = noise(random);
      points.push_back(Eigen::Vector3d(x, y * std::cos(turn) - off * std::sin(turn),
                                       1 + y * std::sin(turn) + off * std::cos(turn))
                           .cast<float>());
    }
}

double angleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::min(1.0, std::abs(a.dot(b)))) * 180 / M_PI;
}

TEST(TrueAxes, areThoseOfTheLargerFaceWithoutTheStripOfTheOther) {
  std::mt19937 random(1);
  Points points;
  addFace(points, 0.10, 0.06, 0, random);
  addFace(points, 0.10, 0.04, M_PI / 2, random);
  const auto axes = trueAxesOf(points);
  ASSERT_FALSE(axes.z.empty());
  for (const auto& z : axes.z) EXPECT_LT(angleDeg(z, Eigen::Vector3d::UnitZ()), 1);
  ASSERT_TRUE(axes.x);
  EXPECT_LT(angleDeg(*axes.x, Eigen::Vector3d::UnitX()), 2);
}

TEST(TrueAxes, ofTwoLikeFacesAreTheNormalsOfBoth) {
  std::mt19937 random(1);
  Points points;
  addFace(points, 0.10, 0.06, 0, random);
  addFace(points, 0.10, 0.06, M_PI / 2, random);
  const auto axes = trueAxesOf(points);
  double to_first = 90, to_second = 90;
  for (const auto& z : axes.z) {
    to_first = std::min(to_first, angleDeg(z, Eigen::Vector3d::UnitZ()));
    to_second = std::min(to_second, angleDeg(z, Eigen::Vector3d::UnitY()));
    EXPECT_LT(
        std::min(angleDeg(z, Eigen::Vector3d::UnitZ()), angleDeg(z, Eigen::Vector3d::UnitY())),
        1.5);
  }
  EXPECT_LT(to_first, 1.5);
  EXPECT_LT(to_second, 1.5);
}

TEST(TrueAxes, thereAreNoneWhereNoPlaneHoldsMuchAndNoLongerSideOfASquare) {
  std::mt19937 random(1);
  Points ball;
  std::normal_distribution<float> any;
  for (int i = 0; i < 5000; ++i)
    ball.push_back(0.1F * Eigen::Vector3f(any(random), any(random), any(random)).normalized());
  EXPECT_TRUE(trueAxesOf(ball).z.empty());
  EXPECT_TRUE(trueAxesOf({}).z.empty());
  Points square;
  addFace(square, 0.06, 0.06, 0, random);
  EXPECT_FALSE(trueAxesOf(square).z.empty());
  EXPECT_FALSE(trueAxesOf(square).x);
}

}  // namespace
}  // namespace tabletop_perception::tools
