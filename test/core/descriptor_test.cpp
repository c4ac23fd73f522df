#include "tabletop_perception/descriptor.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <pcl/features/vfh.h>
#include <pcl/search/kdtree.h>

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

std::vector<Descriptor> cvfhOf(const Surface& surface, const DescriptorOptions& options = {}) {
  return computeCvfh(surface, smoothRegions(surface, options), SENSOR);
}

std::vector<Descriptor> ourCvfhOf(const Surface& surface) {
  return computeOurCvfh(surface, smoothRegions(surface, {}), SENSOR);
}

double l1(const Descriptor& a, const Descriptor& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) sum += std::abs(a.values[i] - b.values[i]);
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

std::vector<float> pclVfhOf(const Surface& surface) {
  const auto points = std::make_shared<pcl::PointCloud<pcl::PointXYZ>>();
  const auto normals = std::make_shared<pcl::PointCloud<pcl::Normal>>();
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const auto &p = surface.points[i], &n = surface.normals[i];
    points->emplace_back(p.x(), p.y(), p.z());
    normals->emplace_back(n.x(), n.y(), n.z());
  }
  pcl::VFHEstimation<pcl::PointXYZ, pcl::Normal, pcl::VFHSignature308> estimation;
  estimation.setInputCloud(points);
  estimation.setInputNormals(normals);
  estimation.setSearchMethod(std::make_shared<pcl::search::KdTree<pcl::PointXYZ>>());
  estimation.setNormalizeDistance(true);
  estimation.setFillSizeComponent(true);
  estimation.setViewPoint(SENSOR.x(), SENSOR.y(), SENSOR.z());
  pcl::PointCloud<pcl::VFHSignature308> signature;
  estimation.compute(signature);
  return {std::begin(signature[0].histogram), std::end(signature[0].histogram)};
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
  EXPECT_EQ(cvfhOf(boxSeenFrom({0, 0, 1}), options).size(), 1u);
  EXPECT_EQ(cvfhOf(boxSeenFrom({1, 1, 0}), options).size(), 2u);
  EXPECT_EQ(cvfhOf(boxSeenFrom({1, 1.2, 1}), options).size(), 3u);
}

TEST(Cvfh, NoiseDoesNotTearFacesApart) {
  const Mesh mesh = scene::box(0.14, 0.12, 0.10);
  for (const unsigned seed : {1, 2, 3}) {
    Cloud image = views::imageOf(mesh, views::lookAt(mesh, {1, 1.2, 1}, 0.8));
    scene::addAxialNoise(image, 0.002, seed);
    EXPECT_EQ(cvfhOf(views::sampled(image)).size(), 3u) << "seed " << seed;
  }
}

TEST(Cvfh, ARoundSideIsOneRegion) {
  const Mesh can = scene::cylinder(0.04, 0.12);
  const auto cvfh = cvfhOf(views::seen(can, views::lookAt(can, {1, 0, 0}, 0.8)));
  EXPECT_EQ(cvfh.size(), 1u);
}

TEST(Cvfh, EachVectorIsWholeAndCarriesTheCentroidOfEverything) {
  const Surface surface = boxSeenFrom({1, 1.2, 1});
  for (const auto& cvfh : cvfhOf(surface)) {
    EXPECT_EQ(cvfh.kind, "cvfh");
    expectWhole(cvfh);
    EXPECT_TRUE(cvfh.centroid.isApprox(centroidOf(surface.points), 1e-6f));
  }
}

TEST(Cvfh, DistancesAreMetresSoThatSizesTellApart) {
  const auto meanDistance = [](double side) {
    const Mesh mesh = scene::box(side, side, 0.05);
    const auto cvfh = cvfhOf(views::seen(mesh, views::lookAt(mesh, {0, 0, 1}, 0.8)));
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
  EXPECT_TRUE(cvfhOf(randomSurface(500, 2)).empty());
  EXPECT_TRUE(cvfhOf({}).empty());
}

TEST(Vfh, AsPclItHasTheBinsOfPcl) {
  const Surface surfaces[] = {
      boxSeenFrom({1, 1.2, 1}), randomSurface(2000, 5),
      views::seen(scene::house(), views::lookAt(scene::house(), {1, 0.7, 0.8}, 0.8))};
  for (const Surface& surface : surfaces) {
    const auto expected = pclVfhOf(surface);
    const auto values = computeVfhAsPcl(surface, SENSOR);
    ASSERT_EQ(values.size(), static_cast<std::size_t>(VFH_SIZE));
    for (const auto& [first, count] : BLOCKS) {
      double difference = 0;
      for (int i = first; i < first + count; ++i) difference += std::abs(values[i] - expected[i]);
      EXPECT_LT(difference, 0.5) << "block at " << first;
    }
  }
}

TEST(OurCvfh, EachBlockIsWhole) {
  const auto all = ourCvfhOf(boxSeenFrom({1, 1.2, 1}));
  ASSERT_GE(all.size(), 3u);  // a frame at least for each face
  constexpr int OUR_BLOCKS[][2] = {{0, 45}, {45, 45}, {90, 45}, {135, 104}, {239, 64}};
  for (const auto& descriptor : all) {
    EXPECT_EQ(descriptor.kind, "our_cvfh");
    ASSERT_EQ(descriptor.values.size(), static_cast<std::size_t>(OUR_CVFH_SIZE));
    for (const auto& [first, count] : OUR_BLOCKS)
      EXPECT_NEAR(sumOf(descriptor.values, first, count), 100, 0.01);
    ASSERT_TRUE(descriptor.axes);
    EXPECT_TRUE(descriptor.axes->isUnitary(1e-4f));
    EXPECT_GT(descriptor.axes->determinant(), 0);
  }
}

TEST(OurCvfh, FramesTurnWithTheObjectWhateverTheCallBefore) {
  const Surface surface =
      views::seen(scene::house(), views::lookAt(scene::house(), {1, 0.7, 0.8}, 0.8));
  const auto before = ourCvfhOf(surface);
  const Eigen::Vector3d gaze = centroidOf(surface.points).cast<double>().normalized();
  const Eigen::Isometry3d roll(Eigen::AngleAxisd(1.1, gaze));
  const auto after = ourCvfhOf(transformed(surface, roll));
  ASSERT_EQ(before.size(), after.size());
  ASSERT_FALSE(before.empty());
  for (const auto& a : before) {
    const Eigen::Matrix3f turned = roll.linear().cast<float>() * *a.axes;
    const bool found = std::any_of(after.begin(), after.end(), [&](const Descriptor& b) {
      return (turned - *b.axes).norm() < 0.02f && l1(a, b) < 15;
    });
    EXPECT_TRUE(found);
  }
}

TEST(OurCvfh, ASquareFaceHasAFrameForEachOfItsTurns) {
  const Mesh mesh = scene::box(0.1, 0.1, 0.05);
  const auto all = ourCvfhOf(views::seen(mesh, views::lookAt(mesh, {0, 0, 1}, 0.8)));
  EXPECT_EQ(all.size(), 4u);
}

TEST(Esf, GroupsAreWholeAndTheSamePointsGiveTheSameVector) {
  const Surface surface = boxSeenFrom({1, 1.2, 1});
  const Descriptor esf = computeEsf(surface, 0.005);
  ASSERT_EQ(esf.values.size(), static_cast<std::size_t>(ESF_SIZE));
  for (const int group : {0, 192, 384}) EXPECT_NEAR(sumOf(esf.values, group, 192), 100, 0.01);
  EXPECT_NEAR(sumOf(esf.values, 576, 64), 100, 0.01);
  EXPECT_EQ(computeEsf(surface, 0.005).values, esf.values);
}

TEST(Esf, LinesOfAFlatFaceRunOnTheSurfaceAndTheSizeDoesNotCount) {
  const auto faceOf = [](double side) {
    const Mesh mesh = scene::box(side, side, 0.05);
    return computeEsf(views::seen(mesh, views::lookAt(mesh, {0, 0, 1}, 0.8)), 0.005);
  };
  const Descriptor small = faceOf(0.1), large = faceOf(0.2);
  EXPECT_GT(sumOf(small.values, 384, 64), 95);
  EXPECT_LT(l1(small, large), 60);  // of 400
  EXPECT_GT(l1(small, computeEsf(boxSeenFrom({1, 1.2, 1}), 0.005)), 120);
}

TEST(Esf, UnderThreePointsAreRefused) {
  EXPECT_EQ(clouds::refusalOf([] { computeEsf({}, 0.005); }),
            "esf: the surface has under three points");
}

TEST(CameraRoll, TurnsOfTheCameraShiftTheBins) {
  const Surface surface = boxSeenFrom({1, 2, 1.5});
  const Descriptor roll = computeCameraRoll(surface, SENSOR);
  ASSERT_EQ(roll.values.size(), static_cast<std::size_t>(ROLL_BINS));
  const Eigen::Vector3d gaze = roll.centroid.cast<double>().normalized();
  const int bins = 7;
  const Eigen::Isometry3d turn(Eigen::AngleAxisd(bins * 2 * M_PI / ROLL_BINS, gaze));
  const Descriptor turned = computeCameraRoll(transformed(surface, turn), SENSOR);
  for (int i = 0; i < ROLL_BINS; ++i)
    EXPECT_NEAR(turned.values[(i + bins) % ROLL_BINS], roll.values[i], 0.1);
}

TEST(CameraRoll, AFaceAcrossTheViewSaysNothing) {
  const Mesh mesh = scene::box(0.1, 0.1, 0.05);
  const auto roll =
      computeCameraRoll(views::seen(mesh, views::lookAt(mesh, {0, 0, 1}, 0.8)), SENSOR);
  EXPECT_LT(sumOf(roll.values, 0, ROLL_BINS), 10);
}

TEST(Descriptor, WantedKindsComeInOrderAndTheCameraRollLast) {
  const Surface surface = boxSeenFrom({1, 1.2, 1});
  const auto kindsOf = [](const std::vector<Descriptor>& all) {
    std::vector<std::string> kinds;
    for (const auto& descriptor : all)
      if (kinds.empty() || kinds.back() != descriptor.kind) kinds.push_back(descriptor.kind);
    return kinds;
  };
  EXPECT_EQ(kindsOf(describeSurface(surface, SENSOR, {})),
            (std::vector<std::string>{"vfh", "cvfh", "our_cvfh", "esf", "camera_roll"}));
  EXPECT_EQ(kindsOf(describeSurface(surface, SENSOR, {}, {"cvfh"})),
            (std::vector<std::string>{"cvfh", "camera_roll"}));
}

TEST(Descriptor, TinySurfacesAreNotDescribed) {
  const DescriptorOptions options;
  EXPECT_TRUE(describeSurface(randomSurface(options.min_points - 1, 3), SENSOR, options).empty());
  EXPECT_FALSE(describeSurface(randomSurface(options.min_points, 3), SENSOR, options).empty());
  EXPECT_TRUE(describeSurface({}, SENSOR, options).empty());
}
