#include "tabletop_perception/descriptor.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "views.h"

using namespace tabletop_perception;

namespace {

constexpr int SHAPE = 45;  // bins of the blocks alpha, phi, theta and distance
constexpr int BLOCKS[][2] = {{0, SHAPE}, {45, SHAPE}, {90, SHAPE}, {135, SHAPE}, {180, 128}};
const Eigen::Vector3f SENSOR = Eigen::Vector3f::Zero();

double sumOf(const std::vector<float>& values, int first, int count) {
  return std::accumulate(values.begin() + first, values.begin() + first + count, 0.0);
}

void expectWhole(const Descriptor& descriptor) {
  ASSERT_EQ(descriptor.values.size(), static_cast<std::size_t>(VFH_SIZE));
  for (const auto& [first, count] : BLOCKS)
    EXPECT_NEAR(sumOf(descriptor.values, first, count), 100, 0.01);
  for (const float value : descriptor.values) EXPECT_TRUE(value >= 0 && value <= 100.01f) << value;
}

/// The bins that hold something, with how much.
std::vector<std::pair<int, float>> filled(const Descriptor& descriptor, int first, int count) {
  std::vector<std::pair<int, float>> bins;
  for (int i = 0; i < count; ++i)
    if (descriptor.values[first + i] > 0) bins.emplace_back(i, descriptor.values[first + i]);
  return bins;
}

using Bins = std::vector<std::pair<int, float>>;

double l1(const Descriptor& a, const Descriptor& b) {
  double sum = 0;
  for (int i = 0; i < VFH_SIZE; ++i) sum += std::abs(a.values[i] - b.values[i]);
  return sum;
}

Surface randomSurface(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> g;
  Surface surface;
  for (int i = 0; i < count; ++i) {
    surface.points.push_back(Eigen::Vector3f(g(random), g(random), g(random)) * 0.05f +
                             Eigen::Vector3f(0.1f, -0.1f, 0.8f));
    surface.normals.push_back(Eigen::Vector3f(g(random), g(random), g(random)).normalized());
  }
  return surface;
}

/// A box seen so that one, two or three of its faces show.
Surface boxSeenFrom(const Eigen::Vector3d& direction) {
  const Mesh mesh = scene::box(0.14, 0.12, 0.10);
  return views::seen(mesh, views::lookAt(mesh, direction, 0.8));
}

}  // namespace

TEST(Vfh, BinsOfTwoPointsByHand) {
  // Centroid (0 0 1), mean normal (0 0 -1), normals leaning 0.6 to the middle.
  Surface surface;
  surface.points = {{-0.1f, 0, 1}, {0.1f, 0, 1}};
  surface.normals = {{0.6f, 0, -0.8f}, {-0.6f, 0, -0.8f}};
  const Descriptor vfh = computeVfh(surface, SENSOR);
  EXPECT_EQ(vfh.kind, "vfh");
  EXPECT_TRUE(vfh.centroid.isApprox(Eigen::Vector3f(0, 0, 1)));
  EXPECT_EQ(filled(vfh, 0, SHAPE), (Bins{{22, 100.0f}}));    // alpha 0
  EXPECT_EQ(filled(vfh, 45, SHAPE), (Bins{{22, 100.0f}}));   // phi 0
  EXPECT_EQ(filled(vfh, 90, SHAPE), (Bins{{17, 100.0f}}));   // theta atan2(-0.6, 0.8) = -0.644
  EXPECT_EQ(filled(vfh, 135, SHAPE), (Bins{{44, 100.0f}}));  // both are the farthest
  EXPECT_EQ(filled(vfh, 180, 128), (Bins{{115, 100.0f}}));   // cosine 0.8 to the line of sight
}

TEST(Vfh, BinsOfNormalsThatLeanSidewaysByHand) {
  Surface surface;
  surface.points = {{-0.1f, 0, 1}, {0.1f, 0, 1}};
  surface.normals = {{0, 0.28f, -0.96f}, {0, -0.28f, -0.96f}};
  const Descriptor vfh = computeVfh(surface, SENSOR);
  EXPECT_EQ(filled(vfh, 0, SHAPE), (Bins{{16, 100.0f}}));   // alpha -0.28
  EXPECT_EQ(filled(vfh, 90, SHAPE), (Bins{{22, 100.0f}}));  // theta 0
}

TEST(Vfh, BinsOfThreePointsByHand) {
  // Centroid (0 0 0.9): one point 0.2 m before it, two 0.141 m behind at 45 degrees.
  Surface surface;
  surface.points = {{-0.1f, 0, 1}, {0.1f, 0, 1}, {0, 0, 0.7f}};
  surface.normals.assign(3, {0, 0, -1});
  const Descriptor vfh = computeVfh(surface, SENSOR);
  const float third = 100.0f / 3;
  EXPECT_EQ(filled(vfh, 0, SHAPE).size(), 1u);
  EXPECT_EQ(filled(vfh, 90, SHAPE).size(), 1u);
  const auto expectThirds = [&](int first, int two_thirds, int one_third) {
    const auto bins = filled(vfh, first, SHAPE);
    ASSERT_EQ(bins.size(), 2u);
    EXPECT_EQ(bins[0].first, two_thirds);
    EXPECT_NEAR(bins[0].second, 2 * third, 0.001);
    EXPECT_EQ(bins[1].first, one_third);
    EXPECT_NEAR(bins[1].second, third, 0.001);
  };
  expectThirds(45, 6, 44);    // phi -0.707 and 1
  expectThirds(135, 31, 44);  // 0.707 and 1 of the farthest
}

TEST(Vfh, EveryBlockSumsToAHundredAndUsesTheWholeOfThePapersRanges) {
  const Descriptor vfh = computeVfh(randomSurface(20000, 1), SENSOR);
  expectWhole(vfh);
  for (const int block : {0, 1, 2, 4}) {
    const auto [first, count] = BLOCKS[block];
    EXPECT_EQ(filled(vfh, first, count).size(), static_cast<std::size_t>(count))
        << "block " << block;  // PCL leaves 30 of the first 45 bins empty
  }
}

TEST(Vfh, DoesNotChangeWhenTheCameraRolls) {
  const Surface surface = boxSeenFrom({1, 2, 1.5});
  const Descriptor vfh = computeVfh(surface, SENSOR);
  const Eigen::Vector3d gaze = vfh.centroid.cast<double>().normalized();
  const Eigen::Isometry3d roll(Eigen::AngleAxisd(1.1, gaze));
  const Descriptor rolled = computeVfh(transformed(surface, roll), SENSOR);
  EXPECT_LT(l1(vfh, rolled), 10);  // of 500: points at the border of their bins
}

TEST(Vfh, DoesNotChangeAlongTheViewingRay) {
  const Surface surface = boxSeenFrom({1, 2, 1.5});
  const Descriptor vfh = computeVfh(surface, SENSOR);
  const Eigen::Isometry3d away(Eigen::Translation3d(0.5 * vfh.centroid.cast<double>()));
  EXPECT_LT(l1(vfh, computeVfh(transformed(surface, away), SENSOR)), 10);
}

TEST(Vfh, TurnsOfTheObjectChangeItMoreThanItsDistance) {
  const Mesh mesh = scene::house();
  const auto vfhOf = [&](const Eigen::Vector3d& direction, double distance) {
    return computeVfh(views::seen(mesh, views::lookAt(mesh, direction, distance)), SENSOR);
  };
  const Eigen::Vector3d direction(1, 0.7, 0.8);
  const Descriptor vfh = vfhOf(direction, 0.8);
  const double by_distance = l1(vfh, vfhOf(direction, 1.0));
  for (const double degrees : {60, 120, 180, 240, 300}) {
    const Eigen::Vector3d other =
        Eigen::AngleAxisd(degrees * M_PI / 180, Eigen::Vector3d::UnitZ()) * direction;
    EXPECT_GT(l1(vfh, vfhOf(other, 0.8)), 1.3 * by_distance) << degrees;
  }
}

TEST(Vfh, APointOfNoExtentIsDescribedWithoutNan) {
  Surface surface;
  surface.points = {{0, 0, 1}};
  surface.normals = {{0, 0, -1}};
  expectWhole(computeVfh(surface, SENSOR));
  surface.points.push_back(surface.points[0]);
  surface.normals.push_back({0, 0, 1});  // the mean normal is zero
  expectWhole(computeVfh(surface, SENSOR));
}

TEST(Vfh, NothingCannotBeDescribed) {
  EXPECT_EQ(clouds::refusalOf([] { computeVfh({}, SENSOR); }), "vfh: the surface has no points");
}

TEST(Cvfh, HasOneVectorForEachVisibleFaceOfABox) {
  const DescriptorOptions options;
  EXPECT_EQ(computeCvfh(boxSeenFrom({0, 0, 1}), SENSOR, options).size(), 1u);
  EXPECT_EQ(computeCvfh(boxSeenFrom({1, 1, 0}), SENSOR, options).size(), 2u);
  EXPECT_EQ(computeCvfh(boxSeenFrom({1, 1.2, 1}), SENSOR, options).size(), 3u);
}

TEST(Cvfh, NoiseDoesNotTearFacesApart) {
  const Mesh mesh = scene::box(0.14, 0.12, 0.10);
  for (const unsigned seed : {1, 2, 3}) {
    Cloud image = views::imageOf(mesh, views::lookAt(mesh, {1, 1.2, 1}, 0.8));
    scene::addAxialNoise(image, 0.002, seed);
    EXPECT_EQ(computeCvfh(views::sampled(image), SENSOR, {}).size(), 3u) << "seed " << seed;
  }
}

TEST(Cvfh, ARoundSideIsOneRegion) {
  const Mesh can = scene::cylinder(0.04, 0.12);
  const auto cvfh = computeCvfh(views::seen(can, views::lookAt(can, {1, 0, 0}, 0.8)), SENSOR, {});
  EXPECT_EQ(cvfh.size(), 1u);
}

TEST(Cvfh, EachVectorIsWholeAndCarriesTheCentroidOfEverything) {
  const Surface surface = boxSeenFrom({1, 1.2, 1});
  for (const auto& cvfh : computeCvfh(surface, SENSOR, {})) {
    EXPECT_EQ(cvfh.kind, "cvfh");
    expectWhole(cvfh);
    EXPECT_TRUE(cvfh.centroid.isApprox(centroidOf(surface.points), 1e-6f));
  }
}

TEST(Cvfh, DistancesAreMetresSoThatSizesTellApart) {
  const auto meanDistance = [](double side) {
    const Mesh mesh = scene::box(side, side, 0.05);
    const auto cvfh =
        computeCvfh(views::seen(mesh, views::lookAt(mesh, {0, 0, 1}, 0.8)), SENSOR, {});
    EXPECT_EQ(cvfh.size(), 1u);
    double mean = 0;
    for (int i = 0; i < SHAPE; ++i) mean += (i + 0.5) * 0.01 * cvfh.at(0).values[135 + i] / 100;
    return mean;
  };
  // The mean distance of a square's points from its middle is 0.3826 of its side.
  EXPECT_NEAR(meanDistance(0.10), 0.0383, 0.003);
  EXPECT_NEAR(meanDistance(0.20), 0.0765, 0.003);
}

TEST(Cvfh, ASurfaceWithoutASmoothRegionHasNone) {
  EXPECT_TRUE(computeCvfh(randomSurface(500, 2), SENSOR, {}).empty());
  EXPECT_TRUE(computeCvfh({}, SENSOR, {}).empty());
}

TEST(Descriptor, VfhComesFirstThenEveryCvfh) {
  const auto all = describeSurface(boxSeenFrom({1, 1.2, 1}), SENSOR, {});
  ASSERT_EQ(all.size(), 4u);
  EXPECT_EQ(all[0].kind, "vfh");
  for (std::size_t i = 1; i < all.size(); ++i) EXPECT_EQ(all[i].kind, "cvfh");
}

TEST(Descriptor, TinySurfacesAreNotDescribed) {
  const DescriptorOptions options;
  EXPECT_TRUE(describeSurface(randomSurface(options.min_points - 1, 3), SENSOR, options).empty());
  EXPECT_FALSE(describeSurface(randomSurface(options.min_points, 3), SENSOR, options).empty());
  EXPECT_TRUE(describeSurface({}, SENSOR, options).empty());
}
