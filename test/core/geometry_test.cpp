#include "tabletop_perception/geometry.h"

#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"

using namespace tabletop_perception;

namespace {

/// Points that fill a box of the given sides, in a frame of their own.
std::vector<Eigen::Vector3f> boxOfPoints(const Eigen::Vector3d& size, const Eigen::Isometry3d& T) {
  std::vector<Eigen::Vector3f> points;
  const int n = 8;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j)
      for (int k = 0; k <= n; ++k) {
        const Eigen::Vector3d share(i - n / 2.0, j - n / 2.0, k - n / 2.0);
        points.push_back((T * (size.cwiseProduct(share) / n)).cast<float>());
      }
  return points;
}

/// The box as it is, whichever way its axes point.
void expectBox(const Box& box, const Eigen::Vector3d& size, const Eigen::Isometry3d& T) {
  EXPECT_TRUE(box.size.isApprox(size, 1e-3)) << box.size.transpose();
  EXPECT_TRUE(box.T_camera_box.translation().isApprox(T.translation(), 1e-4));
  const Eigen::Matrix3d R = box.T_camera_box.linear();
  EXPECT_NEAR(R.determinant(), 1, 1e-6);
  EXPECT_TRUE((R.transpose() * R).isIdentity(1e-6));
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::abs(R.col(i).dot(T.linear().col(i))), 1, 1e-4) << i;
}

}  // namespace

TEST(Geometry, AMovedSurfaceTurnsItsNormals) {
  const Surface source{{{1, 0, 0}, {0, 2, 0}}, {{1, 0, 0}, {0, 0, 1}}};
  const Eigen::Isometry3d T = clouds::motion(90, {0, 0, 1}, {0, 0, 5});
  const Surface target = transformed(source, T);
  EXPECT_TRUE(target.points[0].isApprox(Eigen::Vector3f(0, 1, 5)));
  EXPECT_TRUE(target.points[1].isApprox(Eigen::Vector3f(-2, 0, 5)));
  EXPECT_TRUE(target.normals[0].isApprox(Eigen::Vector3f(0, 1, 0)));
  EXPECT_TRUE(target.normals[1].isApprox(Eigen::Vector3f(0, 0, 1)));
}

TEST(Geometry, TheCentroidIsTheMean) {
  EXPECT_EQ(centroidOf({{1, 2, 3}, {3, 2, 1}, {2, -1, 5}}), Eigen::Vector3f(2, 1, 3));
}

TEST(Geometry, ADownsampledSurfaceHasTheMeanOfEachCube) {
  Surface surface;
  surface.points = clouds::randomPoints(400, 0.05f, 1);
  for (const auto& p : clouds::randomPoints(400, 0.4f, 2))  // all upwards, more or less
    surface.normals.push_back((p + Eigen::Vector3f::UnitZ()).normalized());
  const double leaf = 0.02;
  struct Sum {
    Eigen::Vector3d point = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
    int count = 0;
  };
  std::map<std::tuple<int, int, int>, Sum> cubes;
  const auto cubeOf = [&](const Eigen::Vector3f& p) {
    const Eigen::Vector3i c = (p.cast<double>() / leaf).array().floor().cast<int>();
    return std::make_tuple(c.x(), c.y(), c.z());
  };
  for (std::size_t i = 0; i < surface.size(); ++i) {
    Sum& sum = cubes[cubeOf(surface.points[i])];
    sum.point += surface.points[i].cast<double>();
    sum.normal += surface.normals[i].cast<double>();
    ++sum.count;
  }
  const Surface thin = downsampled(surface, leaf);
  ASSERT_EQ(thin.size(), cubes.size());
  EXPECT_EQ(cubeOf(thin.points[0]), cubeOf(surface.points[0]));
  for (std::size_t i = 0; i < thin.size(); ++i) {
    const Sum& sum = cubes.at(cubeOf(thin.points[i]));
    EXPECT_TRUE(thin.points[i].cast<double>().isApprox(sum.point / sum.count, 1e-4));
    EXPECT_TRUE(thin.normals[i].cast<double>().isApprox(sum.normal.normalized(), 1e-3));
  }
  EXPECT_TRUE(downsampled({}, leaf).empty());
  EXPECT_EQ(clouds::refusalOf([&] { downsampled(surface, -1); }),
            "leaf must be positive, got -1.000000");
}

TEST(Geometry, TheSidesOfAThinWallStayApartWhenDownsampled) {
  Surface wall;
  for (const auto& p : clouds::randomPoints(100, 0.004f, 1)) {
    wall.points.push_back({0.005f + p.x(), 0.005f + p.y(), p.z() > 0 ? 0.006f : 0.004f});
    wall.normals.push_back({0, 0, p.z() > 0 ? 1.0f : -1.0f});
  }
  const Surface thin = downsampled(wall, 0.01);
  ASSERT_EQ(thin.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_NEAR(thin.points[i].z(), thin.normals[i].z() > 0 ? 0.006 : 0.004, 1e-6);
  EXPECT_NE(thin.normals[0], thin.normals[1]);
}

TEST(Geometry, ABoxHasItsPointsAxesAndExtents) {
  const Eigen::Vector3d size(0.3, 0.2, 0.1);
  const Eigen::Isometry3d T = clouds::motion(70, {1, -2, 0.5}, {0.1, -0.2, 0.9});
  expectBox(boxAround(boxOfPoints(size, T), std::nullopt), size, T);
}

TEST(Geometry, ABoxIsUprightWhereUpIsKnown) {
  // Sheared points: the principal axes lean, those of the upright box do not.
  const Eigen::Isometry3d T = clouds::motion(70, {1, -2, 0.5}, {0.1, -0.2, 0.9});
  const Eigen::Vector3d up = T.linear().col(2);
  std::vector<Eigen::Vector3f> leaning;
  for (const auto& p : boxOfPoints({0.1, 0.05, 0.3}, Eigen::Isometry3d::Identity()))
    leaning.push_back((T * Eigen::Vector3d(p.x() + 0.3 * p.z(), p.y(), p.z())).cast<float>());
  const Box box = boxAround(leaning, up);
  EXPECT_NEAR(std::abs(box.T_camera_box.linear().col(0).dot(up)), 1, 1e-6);  // the longest side
  EXPECT_NEAR(box.size[0], 0.3, 1e-4);
  EXPECT_NEAR(box.size[1], 0.1 + 0.3 * 0.3, 1e-4);
  EXPECT_NEAR(box.size[2], 0.05, 1e-4);
  EXPECT_NEAR(box.T_camera_box.linear().determinant(), 1, 1e-6);
}

TEST(Geometry, AnUprightBoxOfWhichTwoSidesShowIsNotAskew) {
  const Eigen::Isometry3d T = clouds::motion(70, {1, -2, 0.5}, {0.1, -0.2, 0.9});
  std::vector<Eigen::Vector3f> seen;  // an L from above, of 8 x 6 cm
  for (double height = 0; height <= 0.1001; height += 0.005) {
    for (double x = 0; x <= 0.0801; x += 0.005)
      seen.push_back((T * Eigen::Vector3d(x, 0, height)).cast<float>());
    for (double y = 0; y <= 0.0601; y += 0.005)
      seen.push_back((T * Eigen::Vector3d(0, y, height)).cast<float>());
  }
  const Box box = boxAround(seen, Eigen::Vector3d(T.linear().col(2)));
  EXPECT_TRUE(box.size.isApprox(Eigen::Vector3d(0.1, 0.08, 0.06), 1e-3)) << box.size.transpose();
}

TEST(Geometry, ABoxHoldsItsPointsWithoutNan) {
  for (const int count : {1, 2, 3, 50})
    for (const bool with_up : {false, true}) {
      const auto points = clouds::randomPoints(count, 0.1f, 3);
      const auto up = with_up ? std::optional<Eigen::Vector3d>({0, 0.6, -0.8}) : std::nullopt;
      const Box box = boxAround(points, up);
      EXPECT_TRUE(box.size[0] >= box.size[1] && box.size[1] >= box.size[2]);
      EXPECT_NEAR(box.T_camera_box.linear().determinant(), 1, 1e-6) << count << " points";
      for (const auto& p : points) {
        const Eigen::Vector3d q = box.T_camera_box.inverse() * p.cast<double>();
        EXPECT_TRUE((q.array().abs() <= box.size.array() / 2 + 1e-6).all());
      }
    }
  EXPECT_TRUE(boxAround({}, std::nullopt).size.isZero());
}

TEST(Geometry, PointsInAColumnAlongUpHaveABox) {
  const std::vector<Eigen::Vector3f> column{{0, 0, 1}, {0, 0, 1.1f}, {0, 0, 1.2f}};
  const Box box = boxAround(column, Eigen::Vector3d::UnitZ());
  EXPECT_TRUE(box.T_camera_box.matrix().allFinite());
  EXPECT_NEAR(box.T_camera_box.linear().determinant(), 1, 1e-6);
  EXPECT_NEAR(box.size[0], 0.2, 1e-6);
}

TEST(Geometry, TheSmallestRotationBringsOneDirectionOntoAnother) {
  const Eigen::Vector3d from = Eigen::Vector3d(1, 2, 3).normalized();
  for (const Eigen::Vector3d& to :
       {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(-0.6, 0, 0.8), from, Eigen::Vector3d(-from)}) {
    const Eigen::Matrix3d R = rotationBetween(from, to);
    EXPECT_TRUE((R * from).isApprox(to, 1e-6));
    EXPECT_NEAR(R.determinant(), 1, 1e-9);
    EXPECT_NEAR(angleOf(R), std::acos(std::min(1.0, std::max(-1.0, from.dot(to)))), 1e-6);
  }
}

TEST(Geometry, TheAngleOfARotationIsBetweenZeroAndPi) {
  for (const double degrees : {0.0, 0.001, 30.0, 179.0, 180.0})
    EXPECT_NEAR(angleOf(clouds::motion(degrees, {1, -1, 2}, {0, 0, 0}).linear()),
                degrees * M_PI / 180, 1e-7);
  EXPECT_NEAR(angleOf(clouds::motion(270, {0, 0, 1}, {0, 0, 0}).linear()), M_PI / 2, 1e-9);
}
