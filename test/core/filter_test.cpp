#include "tabletop_perception/filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"

using namespace tabletop_perception;
using clouds::cloudOf;
using clouds::refusalOf;

namespace {

/// A coloured 40 x 30 grid of random points within 2 m, every seventh pixel without one.
Cloud randomGrid() {
  Cloud cloud(40, 30, true);
  const auto points = clouds::randomPoints(1200, 2.0f, 7);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.rgb[i] = static_cast<std::uint32_t>(i * 12345 & 0xFFFFFF);
    if (i % 7 != 0) cloud.setPoint(i, points[i]);
  }
  return cloud;
}

/// The grid stays, a kept point is the very same, every other one is NaN throughout.
template <typename Predicate>
void expectKeptExactly(const Cloud& before, const Cloud& after, Predicate kept) {
  ASSERT_EQ(after.width, before.width);
  ASSERT_EQ(after.height, before.height);
  EXPECT_EQ(after.rgb, before.rgb);
  int count = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const bool expected = before.valid(i) && kept(before.point(i));
    ASSERT_EQ(after.valid(i), expected) << "point " << i << ": " << before.point(i).transpose();
    if (expected)
      EXPECT_EQ(after.point(i), before.point(i));
    else
      EXPECT_TRUE(std::isnan(after.y[i]) && std::isnan(after.z[i]));
    count += expected;
  }
  EXPECT_GT(count, 10);
  EXPECT_LT(count, 1000);
}

std::vector<Eigen::Vector3f> validPoints(const Cloud& cloud) {
  std::vector<Eigen::Vector3f> points;
  for (const int i : validIndices(cloud)) points.push_back(cloud.point(i));
  return points;
}

}  // namespace

TEST(Filter, RangeIsTheDistanceFromTheSensor) {
  const Cloud cloud = randomGrid();
  expectKeptExactly(cloud, cropRange(cloud, 0.8, 1.7),
                    [](const Eigen::Vector3f& p) { return p.norm() >= 0.8f && p.norm() <= 1.7f; });
}

TEST(Filter, RangeDoesNotDependOnWhichAxisIsForward) {
  const std::vector<Eigen::Vector3f> near_and_far{{0, 0, 1}, {0, 0, 3}, {0, 0, -1}, {0, 0, -3},
                                                  {1, 0, 0}, {3, 0, 0}, {0, -1, 0}, {0, -3, 0}};
  EXPECT_EQ(validIndices(cropRange(cloudOf(near_and_far), 0.5, 2)), (Indices{0, 2, 4, 6}));
}

TEST(Filter, CropsWhileItReadsAsItDoesAfterwards) {
  Cloud cloud = randomGrid();
  const float infinity = std::numeric_limits<float>::infinity();
  cloud.setPoint(3, {infinity, 0, 1});
  cloud.setPoint(7, {0, 0, -infinity});
  const std::size_t n = cloud.size();
  std::vector<float> bytes(4 * n);  // x, y, z and padding
  for (std::size_t i = 0; i < n; ++i)
    for (int axis = 0; axis < 3; ++axis) bytes[4 * i + axis] = cloud.point(i)[axis];
  PackedCloud packed;
  packed.width = cloud.width;
  packed.height = cloud.height;
  packed.point_step = 16;
  packed.row_step = 16 * packed.width;
  packed.fields = {{"x", 0, 7, 1}, {"y", 4, 7, 1}, {"z", 8, 7, 1}};
  packed.data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  packed.data_size = bytes.size() * sizeof(float);

  FilterOptions options;
  options.min_range = 0.8;
  options.max_range = 1.7;
  options.crop_axis = "x";
  options.crop_min = -0.3;
  const Cloud at_once = filterCloud(packed, options);
  const Cloud afterwards = filterCloud(unpackCloud(packed), options);
  EXPECT_EQ(validIndices(at_once), validIndices(afterwards));
  EXPECT_EQ(validPoints(at_once), validPoints(afterwards));
  EXPECT_LT(validIndices(at_once).size(), n);
  EXPECT_GT(validIndices(at_once).size(), 10u);
}

TEST(Filter, PassThroughLooksAtOneAxis) {
  const Cloud cloud = randomGrid();
  for (int axis = 0; axis < 3; ++axis)
    expectKeptExactly(cloud, cropAxis(cloud, axis, -0.3, 0.9), [axis](const Eigen::Vector3f& p) {
      return p[axis] >= -0.3f && p[axis] <= 0.9f;
    });
}

TEST(Filter, ABoxMayBeTurned) {
  const Cloud cloud = randomGrid();
  const Eigen::Isometry3d T = clouds::motion(50, {1, 2, -1}, {0.2, -0.3, 0.1});
  expectKeptExactly(cloud, cropBox(cloud, T, {1.0, 2.0, 3.0}), [&](const Eigen::Vector3f& p) {
    const Eigen::Vector3d q = T.inverse() * p.cast<double>();
    return std::abs(q.x()) <= 0.5 && std::abs(q.y()) <= 1.0 && std::abs(q.z()) <= 1.5;
  });
}

TEST(Filter, TheBoxOptionsTurnAboutXThenYThenZ) {
  FilterOptions options;
  options.min_range = 0;
  options.box = true;
  options.box_z = 0;
  options.box_size_x = 2, options.box_size_y = 0.2, options.box_size_z = 0.2;
  options.box_roll = 0.4;  // about the long side: moves nothing of it
  options.box_yaw = M_PI / 2;
  const Cloud cloud = cloudOf({{0.9f, 0, 0}, {0, 0.9f, 0}, {0, 0, 0.9f}});
  EXPECT_EQ(validIndices(filterCloud(cloud, options)), Indices{1});
  options.box_pitch = M_PI / 2;  // first x to -z; there the yaw moves nothing
  EXPECT_EQ(validIndices(filterCloud(cloud, options)), Indices{2});
}

TEST(Filter, AVoxelGridHasTheMeanOfEachCube) {
  const Cloud cloud = randomGrid();
  const double leaf = 0.5;
  struct Sum {
    Eigen::Vector3d point = Eigen::Vector3d::Zero(), color = Eigen::Vector3d::Zero();
    int count = 0;
  };
  std::map<std::tuple<int, int, int>, Sum> cubes;
  const auto colorOf = [](std::uint32_t rgb) {
    return Eigen::Vector3d(rgb >> 16 & 0xFF, rgb >> 8 & 0xFF, rgb & 0xFF);
  };
  const auto cubeOf = [&](const Eigen::Vector3f& p) {
    const Eigen::Vector3i c = (p.cast<double>() / leaf).array().floor().cast<int>();
    return std::make_tuple(c.x(), c.y(), c.z());
  };
  for (const int i : validIndices(cloud)) {
    Sum& sum = cubes[cubeOf(cloud.point(i))];
    sum.point += cloud.point(i).cast<double>();
    sum.color += colorOf(cloud.rgb[i]);
    ++sum.count;
  }

  const Cloud grid = voxelGrid(cloud, leaf);
  EXPECT_FALSE(grid.organized());
  ASSERT_EQ(grid.size(), cubes.size());
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const auto cube = cubes.find(cubeOf(grid.point(i)));  // a mean lies in its own cube
    ASSERT_NE(cube, cubes.end());
    const Sum& sum = cube->second;
    EXPECT_NEAR((grid.point(i).cast<double>() - sum.point / sum.count).norm(), 0, 1e-6);
    EXPECT_LE((colorOf(grid.rgb[i]) - sum.color / sum.count).cwiseAbs().maxCoeff(), 0.5);
    cubes.erase(cube);
  }
}

TEST(Filter, AVoxelGridOfHugeExtentStillMerges) {
  // PCL's 32 bit index overflows here and gives the input back.
  const Cloud cloud = cloudOf({{-9000, -9000, -9000},
                               {-9000.0004f, -9000, -9000},
                               {9000, 9000, 9000},
                               {0.0001f, 0.0001f, 0.0001f},
                               {0.0005f, 0.0005f, 0.0005f}});
  const Cloud grid = voxelGrid(cloud, 0.001);
  ASSERT_EQ(grid.size(), 3u);
  EXPECT_TRUE(grid.point(2).isApprox(Eigen::Vector3f::Constant(0.0003f), 1e-5f));
}

TEST(Filter, StatisticalOutliersAreThoseOfTheBruteForceVersion) {
  const Cloud cloud = randomGrid();
  const auto points = validPoints(cloud);
  const int k = 8;
  std::vector<double> mean_distance;
  for (const auto& p : points) {
    std::vector<double> distances;
    for (const auto& q : points) distances.push_back((p - q).cast<double>().norm());
    std::sort(distances.begin(), distances.end());
    double sum = 0;
    for (int i = 1; i <= k; ++i) sum += distances[i];
    mean_distance.push_back(sum / k);
  }
  double mean = 0, variance = 0;
  for (const double d : mean_distance) mean += d / points.size();
  for (const double d : mean_distance) variance += (d - mean) * (d - mean) / points.size();
  const double limit = mean + 1.5 * std::sqrt(variance);

  const Cloud kept = removeStatisticalOutliers(cloud, k, 1.5);
  EXPECT_EQ(kept.width, 40);
  EXPECT_EQ(kept.height, 30);
  const Indices valid = validIndices(cloud);
  int dropped = 0;
  for (std::size_t i = 0; i < valid.size(); ++i) {
    if (std::abs(mean_distance[i] - limit) < 1e-5) continue;
    EXPECT_EQ(kept.valid(valid[i]), mean_distance[i] < limit) << valid[i];
    dropped += mean_distance[i] > limit;
  }
  EXPECT_GT(dropped, 10);
}

TEST(Filter, RadiusOutliersAreThoseOfTheBruteForceVersion) {
  const Cloud cloud = randomGrid();
  const auto points = validPoints(cloud);
  const Cloud kept = removeRadiusOutliers(cloud, 4, 0.35);
  expectKeptExactly(cloud, kept, [&](const Eigen::Vector3f& p) {
    const auto within = std::count_if(points.begin(), points.end(), [&](const Eigen::Vector3f& q) {
      return (p - q).norm() <= 0.35f;
    });
    return within - 1 >= 4;
  });
}

TEST(Filter, OutliersOfFewPointsAreNoError) {
  const Cloud one = cloudOf({{0, 0, 1}});
  EXPECT_EQ(validIndices(removeStatisticalOutliers(one, 20, 2)), Indices{0});
  EXPECT_TRUE(validIndices(removeRadiusOutliers(one, 1, 0.1)).empty());
  const Cloud nothing(4, 3, false);
  EXPECT_EQ(removeStatisticalOutliers(nothing, 20, 2).height, 3);
  EXPECT_EQ(removeRadiusOutliers(nothing, 20, 2).height, 3);
  EXPECT_TRUE(voxelGrid(nothing, 0.01).empty());
  EXPECT_TRUE(filterCloud(Cloud(), FilterOptions()).empty());
}

TEST(Filter, ByDefaultOnlyTheRangeIsCropped) {
  const Cloud cloud = randomGrid();
  expectKeptExactly(cloud, filterCloud(cloud, FilterOptions()),
                    [](const Eigen::Vector3f& p) { return p.norm() >= 0.1f && p.norm() <= 2.0f; });
}

TEST(Filter, TheOptionsNameEveryFilter) {
  const Cloud cloud = randomGrid();
  FilterOptions options;
  options.crop_axis = "y";
  options.crop_min = 0, options.crop_max = 1;
  expectKeptExactly(cloud, filterCloud(cloud, options), [](const Eigen::Vector3f& p) {
    return p.norm() >= 0.1f && p.norm() <= 2.0f && p.y() >= 0 && p.y() <= 1;
  });
  options.outliers = "radius";
  options.outlier_neighbors = 1;
  options.outlier_radius = 0.2;
  const Cloud thinned = filterCloud(cloud, options);
  options.outliers = "none";
  EXPECT_EQ(thinned.x.size(), cloud.size());
  EXPECT_EQ(validIndices(thinned),
            validIndices(removeRadiusOutliers(filterCloud(cloud, options), 1, 0.2)));
  options.leaf_size = 0.1;
  const Cloud grid = filterCloud(cloud, options);
  EXPECT_EQ(grid.height, 1);
  EXPECT_EQ(validIndices(grid).size(), grid.size());
}

TEST(Filter, ContradictionsAreRefusedByNameAndValue) {
  const Cloud cloud = cloudOf({{0, 0, 1}});
  const auto refusal = [&](const auto& change) {
    FilterOptions options;
    change(options);
    return refusalOf([&] { filterCloud(cloud, options); });
  };
  EXPECT_EQ(refusal([](auto& o) { o.min_range = 3; }),
            "filter.min_range must be below filter.max_range, got 3 and 2");
  EXPECT_EQ(refusal([](auto& o) { o.crop_min = o.crop_max; }),
            "filter.crop_min must be below filter.crop_max, got 2.5 and 2.5");
  EXPECT_EQ(refusal([](auto& o) { o.leaf_size = -0.01; }),
            "filter.leaf_size must be between 0 and 0.1, got -0.01");
  EXPECT_EQ(refusal([](auto& o) { o.outliers = "median"; }),
            "filter.outliers must be one of none, statistical, radius, got 'median'");
  EXPECT_EQ(refusal([](auto& o) { o.max_range = clouds::NO_POINT; }),
            "filter.max_range must be between 0.01 and 100, got nan");
  EXPECT_NE(refusalOf([&] { voxelGrid(cloud, 0); }), "was not refused");
}
