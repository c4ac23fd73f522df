#include "tabletop_perception/normals.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "clouds.h"
#include "views.h"

using namespace tabletop_perception;
using clouds::refusalOf;

namespace {

constexpr double DEG = M_PI / 180;
const Eigen::Vector3f SENSOR = Eigen::Vector3f::Zero();

Eigen::Vector3d normalAt(const Normals& normals, std::size_t i) {
  return Eigen::Vector3f(normals.x[i], normals.y[i], normals.z[i]).cast<double>();
}

bool isNone(const Normals& normals, std::size_t i) {
  return std::isnan(normals.x[i]) && std::isnan(normals.y[i]) && std::isnan(normals.z[i]) &&
         std::isnan(normals.curvature[i]);
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / DEG;
}

/// A camera of 80 x 60 pixels that sees surfaces given by the range along each ray; none where the
/// range is not positive.
template <typename Range>
Cloud seenBy(Range range) {
  Cloud cloud(80, 60, false);
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u) {
      const Eigen::Vector3d ray = Eigen::Vector3d((u - 39.5) / 260, (v - 29.5) / 260, 1);
      const double r = range(ray.normalized());
      if (r > 0)
        cloud.setPoint(static_cast<std::size_t>(v) * 80 + u, (r * ray.normalized()).cast<float>());
    }
  return cloud;
}

/// Range to the plane n p = d.
auto plane(const Eigen::Vector3d& n, double d) {
  return [=](const Eigen::Vector3d& ray) { return d / n.dot(ray); };
}

/// Range to a ball about `center`, 0 past it.
auto ball(const Eigen::Vector3d& center, double radius) {
  return [=](const Eigen::Vector3d& ray) {
    const double along = ray.dot(center);
    const double square = along * along - center.squaredNorm() + radius * radius;
    return square > 0 ? along - std::sqrt(square) : 0;
  };
}

/// The methods by integral images.
constexpr const char* INTEGRAL[] = {"average_depth_change", "average_3d_gradient", "covariance"};

NormalsOptions byMethod(const char* method, double smoothing = 7) {
  NormalsOptions options;
  options.method = method;
  options.smoothing = smoothing;
  return options;
}

/// Pixels on the outermost ring of the image of 80 x 60.
bool atBorder(std::size_t i) { return i % 80 == 0 || i % 80 == 79 || i / 80 == 0 || i / 80 == 59; }

NormalsOptions atEveryPixel() {
  NormalsOptions options;
  options.window = 7;
  options.step = 1;
  return options;
}

}  // namespace

TEST(Normals, OfAPlaneAreExactAtEveryPixel) {
  for (const Eigen::Vector3d& normal : {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0.3, -0.8, -0.6),
                                        Eigen::Vector3d(-0.9, 0.1, -0.5)}) {
    const Cloud cloud = seenBy(plane(normal.normalized(), -0.5));
    const Normals normals = computeNormals(cloud, SENSOR, atEveryPixel());
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      ASSERT_LT(angleBetween(normalAt(normals, i), normal), 0.1) << "pixel " << i;
      ASSERT_NEAR(normalAt(normals, i).norm(), 1, 1e-5);
      ASSERT_LT(normals.curvature[i], 1e-4);
    }
  }
}

TEST(Normals, OfABallPointAwayFromItsMiddle) {
  const Eigen::Vector3d center(0.02, -0.01, 0.8);
  const Cloud cloud = seenBy(ball(center, 0.07));
  const Normals normals = computeNormals(cloud, SENSOR, atEveryPixel());
  int looked_at = 0;
  for (const int i : validIndices(cloud)) {
    const Eigen::Vector3d out = (cloud.point(i).cast<double>() - center).normalized();
    if (out.dot(-cloud.point(i).cast<double>().normalized()) < 0.75) continue;  // at the rim
    ASSERT_LT(angleBetween(normalAt(normals, i), out), 1.5) << "pixel " << i;
    ++looked_at;
  }
  EXPECT_GT(looked_at, 500);
}

TEST(Normals, BetweenTheStepsAreThoseOfANeighbourOnTheSameSurface) {
  // A ball before a wall: its rim is where a neighbour may lie on the other surface.
  const Eigen::Vector3d center(0.02, -0.01, 0.8), facing(0, 0, -1);
  const Cloud cloud = seenBy([&](const Eigen::Vector3d& ray) {
    const double range = ball(center, 0.07)(ray);
    return range > 0 ? range : plane(facing, -1.2)(ray);
  });
  for (const int step : {2, 3}) {
    NormalsOptions options;
    options.step = step;
    options.window = 3;  // the ball bends within a larger one
    const Normals normals = computeNormals(cloud, SENSOR, options);
    int with_normal = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      if (isNone(normals, i)) continue;
      ++with_normal;
      const bool on_wall = cloud.z[i] > 1;
      const Eigen::Vector3d out = (cloud.point(i).cast<double>() - center).normalized();
      ASSERT_LT(angleBetween(normalAt(normals, i), on_wall ? facing : out), on_wall ? 0.5 : 30)
          << "pixel " << i << ", step " << step;
    }
    EXPECT_GT(with_normal, 0.97 * cloud.size()) << "step " << step;
  }
}

TEST(Normals, TurnTowardsTheViewpoint) {
  const Cloud cloud = seenBy(plane(Eigen::Vector3d(0.3, -0.8, -0.6).normalized(), -0.5));
  const Eigen::Vector3f behind(0, 0, 5);
  const Normals front = computeNormals(cloud, SENSOR, NormalsOptions());
  const Normals back = computeNormals(cloud, behind, NormalsOptions());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_GT(normalAt(front, i).dot(-cloud.point(i).cast<double>()), 0);
    ASSERT_GT(normalAt(back, i).dot((behind - cloud.point(i)).cast<double>()), 0);
  }
}

TEST(Normals, AreNoneWithoutAPointOrNeighbours) {
  Cloud cloud = seenBy(plane({0, 0, -1}, -0.5));
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u)
      if (u < 40 || (u > 50 && (u % 9 != 0 || v % 9 != 0)))
        cloud.drop(static_cast<std::size_t>(v) * 80 + u);
  const Normals normals = computeNormals(cloud, SENSOR, NormalsOptions());
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * 80 + u;
      const bool lonely = u > 55;
      if (cloud.valid(i) && u > 50 && !lonely) continue;  // near the wall's edge: either
      EXPECT_EQ(isNone(normals, i), !cloud.valid(i) || lonely) << u << ", " << v;
    }
}

TEST(Normals, PointsOnALineHaveNone) {
  Cloud row(80, 3, false);
  for (int u = 0; u < 80; ++u) row.setPoint(80 + u, {0.002f * u, 0, 1});
  const Normals grid = computeNormals(row, SENSOR, NormalsOptions());
  for (std::size_t i = 0; i < row.size(); ++i) EXPECT_TRUE(isNone(grid, i));
  const Normals tree = computeNormals(clouds::unorganised(row), SENSOR, NormalsOptions());
  for (std::size_t i = 0; i < row.size(); ++i) EXPECT_TRUE(isNone(tree, i));
}

TEST(Normals, DoNotMixAcrossAStepInDepth) {
  // A slanting board on the left before a slanting wall, 0.15 m behind it.
  const Eigen::Vector3d board = Eigen::Vector3d(0.4, 0, -1).normalized(),
                        wall = Eigen::Vector3d(0, 0.5, -1).normalized();
  const Cloud cloud = seenBy([&](const Eigen::Vector3d& ray) {
    return ray.x() < 0 ? plane(board, -0.6)(ray) : plane(wall, -0.8)(ray);
  });
  const Normals normals = computeNormals(cloud, SENSOR, NormalsOptions());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const auto& truth = i % 80 < 40 ? board : wall;
    ASSERT_LT(angleBetween(normalAt(normals, i), truth), 0.2) << "column " << i % 80;
  }
}

TEST(Normals, WithoutTheGridAgreeWithThoseOnIt) {
  const Eigen::Vector3d center(0.02, -0.01, 0.8);
  const Cloud cloud = seenBy(ball(center, 0.07));
  NormalsOptions options = atEveryPixel();
  options.neighbors = 49;  // as many as the window holds
  const Normals grid = computeNormals(cloud, SENSOR, options);
  const Normals tree = computeNormals(clouds::unorganised(cloud), SENSOR, options);
  int compared = 0;
  for (const int i : validIndices(cloud)) {
    const Eigen::Vector3d out = (cloud.point(i).cast<double>() - center).normalized();
    if (out.dot(-cloud.point(i).cast<double>().normalized()) < 0.75) continue;
    ASSERT_LT(angleBetween(normalAt(grid, i), normalAt(tree, i)), 2);
    ++compared;
  }
  EXPECT_GT(compared, 500);
}

TEST(Normals, WithoutTheGridAreThoseOfTheBruteForceVersion) {
  const Cloud cloud = clouds::cloudOf(clouds::randomPoints(300, 0.1f, 5));
  NormalsOptions options;
  options.neighbors = 12;
  const Normals normals = computeNormals(cloud, {0, 0, 3}, options);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    std::vector<Eigen::Vector3d> near;
    for (std::size_t j = 0; j < cloud.size(); ++j) near.push_back(cloud.point(j).cast<double>());
    const Eigen::Vector3d p = near[i];
    std::sort(near.begin(), near.end(), [&](const auto& a, const auto& b) {
      return (a - p).squaredNorm() < (b - p).squaredNorm();
    });
    near.resize(12);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const auto& q : near) mean += q / 12;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    for (const auto& q : near) covariance += (q - mean) * (q - mean).transpose() / 12;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
    const Eigen::Vector3d values = solver.eigenvalues();
    EXPECT_NEAR(normals.curvature[i], values[0] / values.sum(), 1e-3);
    if (values[1] < 1.2 * values[0]) continue;  // no direction stands out
    EXPECT_GT(std::abs(normalAt(normals, i).dot(solver.eigenvectors().col(0))), 0.9999);
  }
}

TEST(IntegralNormals, OfAPlaneAreExactUpToTheBorderOfTheImage) {
  for (const char* method : INTEGRAL) {
    // Mean ranges of a plane that slants are not quite the range of the mean.
    const double tolerance = method == std::string("average_depth_change") ? 2 : 0.1;
    for (const Eigen::Vector3d& normal :
         {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0.3, -0.8, -0.6),
          Eigen::Vector3d(-0.9, 0.1, -0.5)}) {
      const Cloud cloud = seenBy(plane(normal.normalized(), -0.5));
      const Normals normals = computeNormals(cloud, SENSOR, byMethod(method));
      for (std::size_t i = 0; i < cloud.size(); ++i) {
        ASSERT_EQ(isNone(normals, i), atBorder(i)) << method << ", pixel " << i;
        if (atBorder(i)) continue;
        ASSERT_LT(angleBetween(normalAt(normals, i), normal), tolerance) << method << " " << i;
        ASSERT_NEAR(normalAt(normals, i).norm(), 1, 1e-5);
      }
    }
  }
}

TEST(IntegralNormals, OfABallPointAwayFromItsMiddle) {
  const Eigen::Vector3d center(0.02, -0.01, 0.8);
  const Cloud cloud = seenBy(ball(center, 0.07));
  for (const char* method : INTEGRAL) {
    const Normals normals = computeNormals(cloud, SENSOR, byMethod(method));
    int looked_at = 0;
    for (const int i : validIndices(cloud)) {
      const Eigen::Vector3d out = (cloud.point(i).cast<double>() - center).normalized();
      if (out.dot(-cloud.point(i).cast<double>().normalized()) < 0.75) continue;  // at the rim
      ASSERT_LT(angleBetween(normalAt(normals, i), out), 3) << method << ", pixel " << i;
      ++looked_at;
    }
    EXPECT_GT(looked_at, 500);
  }
}

TEST(IntegralNormals, SquaresEndAtAJumpInRange) {
  // A slanting board on the left before a slanting wall, 0.15 m behind it.
  const Eigen::Vector3d board = Eigen::Vector3d(0.4, 0, -1).normalized(),
                        wall = Eigen::Vector3d(0, 0.5, -1).normalized();
  const Cloud cloud = seenBy([&](const Eigen::Vector3d& ray) {
    return ray.x() < 0 ? plane(board, -0.6)(ray) : plane(wall, -0.8)(ray);
  });
  for (const char* method : INTEGRAL) {
    const Normals normals = computeNormals(cloud, SENSOR, byMethod(method, 20));
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const bool at_jump = i % 80 >= 38 && i % 80 <= 41;  // and beside it
      ASSERT_EQ(isNone(normals, i), at_jump || atBorder(i)) << method << ", pixel " << i;
      if (at_jump || atBorder(i)) continue;
      ASSERT_LT(angleBetween(normalAt(normals, i), i % 80 < 40 ? board : wall), 1)
          << method << ", column " << i % 80;
    }
  }
}

TEST(IntegralNormals, SquaresLeaveOutPixelsWithoutAPoint) {
  const Eigen::Vector3d facing(0, 0, -1);
  Cloud cloud = seenBy(plane(facing, -0.5));
  for (int v = 20; v < 24; ++v)
    for (int u = 30; u < 36; ++u) cloud.drop(static_cast<std::size_t>(v) * 80 + u);
  for (const char* method : INTEGRAL) {
    const Normals normals = computeNormals(cloud, SENSOR, byMethod(method, 20));
    for (int v = 0; v < 60; ++v)
      for (int u = 0; u < 80; ++u) {
        const std::size_t i = static_cast<std::size_t>(v) * 80 + u;
        const bool at_hole = u >= 29 && u < 37 && v >= 19 && v < 25;  // in it and beside it
        ASSERT_EQ(isNone(normals, i), at_hole || atBorder(i)) << method << ", " << u << ", " << v;
        if (isNone(normals, i)) continue;
        ASSERT_LT(angleBetween(normalAt(normals, i), facing), 0.2);
      }
  }
}

TEST(IntegralNormals, SquaresGrowWithTheRange) {
  // Noise averages out over larger squares: at twice the range, as at twice the smoothing.
  const auto meanError = [](double range, const char* method, double smoothing) {
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0, 0.001 * range);
    const Cloud cloud =
        seenBy([&](const Eigen::Vector3d& ray) { return range / ray.z() + noise(random); });
    const Normals normals = computeNormals(cloud, SENSOR, byMethod(method, smoothing));
    double sum = 0;
    int count = 0;
    for (int v = 15; v < 45; ++v)
      for (int u = 15; u < 65; ++u, ++count)
        sum += angleBetween(normalAt(normals, static_cast<std::size_t>(v) * 80 + u), {0, 0, -1});
    return sum / count;
  };
  for (const char* method : INTEGRAL) {
    const double near = meanError(1, method, 5), far = meanError(2, method, 5);
    EXPECT_LT(far, 0.5 * near) << method;
    EXPECT_NEAR(far, meanError(1, method, 10), 0.1 * far) << method;
  }
}

TEST(IntegralNormals, OnlyCovariancesTellTheCurvature) {
  const Cloud cloud = seenBy(plane({0, 0, -1}, -0.5));
  const std::size_t middle = 30 * 80 + 40;
  EXPECT_LT(computeNormals(cloud, SENSOR, byMethod("covariance")).curvature[middle], 1e-4);
  for (const char* method : {"average_depth_change", "average_3d_gradient"})
    EXPECT_TRUE(std::isnan(computeNormals(cloud, SENSOR, byMethod(method)).curvature[middle]));
}

TEST(IntegralNormals, OfNothingAreNone) {
  for (const char* method : INTEGRAL)
    for (const Cloud& cloud : {Cloud(5, 4, false), Cloud(1, 6, false)}) {
      const Normals normals = computeNormals(cloud, SENSOR, byMethod(method));
      for (std::size_t i = 0; i < cloud.size(); ++i) EXPECT_TRUE(isNone(normals, i));
    }
}

TEST(Normals, AnUnknownMethodIsRefused) {
  EXPECT_EQ(refusalOf([] { computeNormals(Cloud(), SENSOR, byMethod("magic")); }),
            "normals.method must be one of window, average_depth_change, average_3d_gradient, "
            "covariance, got 'magic'");
}

TEST(Normals, OfNothingAreNone) {
  EXPECT_TRUE(computeNormals(Cloud(), SENSOR, NormalsOptions()).x.empty());
  for (const Cloud& cloud : {Cloud(5, 4, false), Cloud(20, 1, false)}) {
    const Normals normals = computeNormals(cloud, SENSOR, NormalsOptions());
    ASSERT_EQ(normals.x.size(), 20u);
    for (std::size_t i = 0; i < 20; ++i) EXPECT_TRUE(isNone(normals, i));
  }
}

TEST(SampleSurface, HasOnePointPerCubeWithTheNormalOfItsPlace) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.8, -0.6).normalized();
  const Cloud cloud = seenBy(plane(normal, -0.5));
  std::vector<Eigen::Vector3f> points;
  for (const int i : validIndices(cloud)) points.push_back(cloud.point(i));
  const Surface surface = sampleSurface(points, 0.01, 0.03, SENSOR);
  ASSERT_EQ(surface.normals.size(), surface.points.size());
  EXPECT_GT(surface.size(), 200u);
  EXPECT_LT(surface.size(), points.size() / 2);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    EXPECT_NEAR(normal.dot(surface.points[i].cast<double>()), -0.5, 1e-5);
    EXPECT_LT(angleBetween(surface.normals[i].cast<double>(), normal), 0.1);
  }
}

TEST(SampleSurface, LonelyPointsAreLeftOut) {
  EXPECT_TRUE(sampleSurface({}, 0.005, 0.015, SENSOR).empty());
  EXPECT_TRUE(
      sampleSurface({{0, 0, 1}, {0.01f, 0, 1}, {0, 0.01f, 1}}, 0.005, 0.015, SENSOR).empty());
}

TEST(SampleSurface, ALeafMustBePositive) {
  EXPECT_NE(clouds::refusalOf([] {
              sampleSurface({{0, 0, 1}}, 0, 0.015, SENSOR);
            }),
            "was not refused");
}
