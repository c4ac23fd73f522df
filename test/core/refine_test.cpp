#include "tabletop_perception/refine.h"

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "views.h"

using namespace tabletop_perception;

namespace {

constexpr double DEG = M_PI / 180;

/// A house in front of the camera, and the points of its surface that face the camera.
struct Fixture {
  /// `cell`: of the grid of nearest points, which bounds how exactly points correspond [m].
  explicit Fixture(const Mesh& mesh, double cell) {
    model = views::surfaceOf(mesh, 0.003);
    grid = NearestGrid(model, cell, 0.04);
    truth = views::lookAt(mesh, {1, 0.7, 0.8}, 0.8);
    const Surface whole = transformed(model, truth);
    for (std::size_t i = 0; i < whole.size(); i += 3) {
      if (whole.normals[i].dot(whole.points[i]) > -0.2f * whole.points[i].norm()) continue;
      cluster.points.push_back(whole.points[i]);
      cluster.normals.push_back(whole.normals[i]);
    }
  }

  /// The truth, turned about the middle of the cluster and shifted.
  Eigen::Isometry3d disturbed(double degrees, const Eigen::Vector3d& axis,
                              const Eigen::Vector3d& shift) const {
    const Eigen::Vector3d middle = centroidOf(cluster.points).cast<double>();
    return Eigen::Translation3d(middle) * clouds::motion(degrees, axis, shift) *
           Eigen::Translation3d(-middle) * truth;
  }

  Found<Alignment> refine(const Eigen::Isometry3d& start, const RefineOptions& options = {}) const {
    return refinePose(cluster, grid, start, options);
  }

  Surface model, cluster;
  NearestGrid grid;
  Eigen::Isometry3d truth;
};

const Fixture& house() {
  static const Fixture fixture(scene::house(), 0.002);
  return fixture;
}

RefineOptions byMethod(const std::string& method) {
  RefineOptions options;
  options.method = method;
  return options;
}

double angleOff(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return angleOf(a.linear().transpose() * b.linear()) / DEG;
}

/// Farthest that a point of the surface lies from where it belongs [m].
double farthestOff(const Surface& model, const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  double farthest = 0;
  for (const auto& p : model.points)
    farthest = std::max(farthest, (a * p.cast<double>() - b * p.cast<double>()).norm());
  return farthest;
}

}  // namespace

class Refine : public testing::TestWithParam<const char*> {};

TEST_P(Refine, RecoversAKnownMotion) {
  const auto options = byMethod(GetParam());
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0.5), Eigen::Vector3d(-1, 0.3, 2)}) {
    const auto start = house().disturbed(4, axis, {0.004, -0.003, 0.005});
    const auto alignment = house().refine(start, options);
    ASSERT_TRUE(alignment) << alignment.reason;
    EXPECT_TRUE(alignment->converged);
    EXPECT_LT(angleOff(alignment->T_camera_object, house().truth), 0.1);
    EXPECT_LT(farthestOff(house().model, alignment->T_camera_object, house().truth), 0.0003);
    EXPECT_LT((alignment->T_camera_object.translation() - house().truth.translation()).norm(),
              0.0001);
    EXPECT_LT(alignment->rms, 0.001);  // the grid's neighbour is not always the nearest
    EXPECT_GT(alignment->overlap, 0.97);
  }
}

TEST_P(Refine, StaysWhereItIsRight) {
  const auto alignment = house().refine(house().truth, byMethod(GetParam()));
  ASSERT_TRUE(alignment) << alignment.reason;
  EXPECT_LT(farthestOff(house().model, alignment->T_camera_object, house().truth), 3e-4);
}

TEST_P(Refine, TurnsWithTheScene) {
  const auto options = byMethod(GetParam());
  const Eigen::Isometry3d T = clouds::motion(180, {1, 0, 0}, {0, 0, 0});
  const auto start = house().disturbed(4, {1, 1, 0}, {0.004, -0.003, 0.005});
  const auto alignment = house().refine(start, options);
  const auto turned = refinePose(transformed(house().cluster, T), house().grid, T * start, options);
  ASSERT_TRUE(alignment && turned);
  EXPECT_LT(farthestOff(house().model, T * alignment->T_camera_object, turned->T_camera_object),
            1e-4);
}

TEST_P(Refine, APoseIsARotation) {
  const auto alignment =
      house().refine(house().disturbed(6, {1, 1, 1}, {0, 0, 0.01}), byMethod(GetParam()));
  ASSERT_TRUE(alignment);
  const Eigen::Matrix3d R = alignment->T_camera_object.linear();
  EXPECT_TRUE((R.transpose() * R).isIdentity(1e-9));
  EXPECT_NEAR(R.determinant(), 1, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Methods, Refine,
                         testing::Values("point_to_plane", "point_to_point", "gicp"));

TEST(RefinePose, TrimmingLeavesOutliersOut) {
  Fixture fixture(scene::house(), 0.004);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> off(0.004f, 0.02f);
  for (std::size_t i = 0; i < fixture.cluster.size(); i += 5)  // 20 %
    fixture.cluster.points[i] += off(random) * fixture.cluster.normals[i];
  RefineOptions options;
  options.trim = 0.75;
  const auto start = fixture.disturbed(3, {1, 1, 0}, {0.003, 0.003, -0.003});
  const auto alignment = fixture.refine(start, options);
  ASSERT_TRUE(alignment) << alignment.reason;
  EXPECT_LT(farthestOff(fixture.model, alignment->T_camera_object, fixture.truth), 0.0005);
  options.trim = 1;
  const auto all = fixture.refine(start, options);
  ASSERT_TRUE(all);
  EXPECT_GT(farthestOff(fixture.model, all->T_camera_object, fixture.truth),
            farthestOff(fixture.model, alignment->T_camera_object, fixture.truth));
}

TEST(RefinePose, APointThatIsNotFiniteChangesNothing) {
  const auto start = house().disturbed(4, {1, 1, 0}, {0.004, -0.003, 0.005});
  const auto alignment = house().refine(start);
  ASSERT_TRUE(alignment);
  for (const float value : {clouds::NO_POINT, std::numeric_limits<float>::infinity()}) {
    Surface cluster = house().cluster;
    const auto middle = static_cast<std::ptrdiff_t>(cluster.size() / 2);
    cluster.points.insert(cluster.points.begin() + middle, {0, value, 1});
    cluster.normals.insert(cluster.normals.begin() + middle, {0, 0, value});
    const auto same = refinePose(cluster, house().grid, start, RefineOptions());
    ASSERT_TRUE(same) << same.reason;
    EXPECT_EQ(same->T_camera_object.matrix(), alignment->T_camera_object.matrix());
    EXPECT_EQ(same->rms, alignment->rms);
    EXPECT_EQ(same->overlap, alignment->overlap);
  }
}

TEST(RefinePose, TooLittleOverlapIsNoPose) {
  const auto none = house().refine(Eigen::Translation3d(0.5, 0, 0) * house().truth);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.reason, "0 % of the points lie on the model, limit 30 % (0 points)");

  Fixture half(scene::house(), 0.004);
  for (std::size_t i = 0; i < half.cluster.size(); ++i)
    if (i % 2 == 0) half.cluster.points[i].x() += 1;  // a second object, far away
  RefineOptions options;
  options.min_overlap = 0.6;
  EXPECT_EQ(half.refine(half.truth, options).reason.substr(0, 33),
            "47 % of the points lie on the mod");
  options.min_overlap = 0.4;
  EXPECT_TRUE(half.refine(half.truth, options));
}

TEST(RefinePose, FewerThanSixPointsAreNoPose) {
  Surface few = house().cluster;
  few.points.resize(5);
  few.normals.resize(5);
  const auto refined = [&](const Surface& cluster) {
    return refinePose(cluster, house().grid, house().truth, RefineOptions());
  };
  EXPECT_FALSE(refined(few));
  EXPECT_FALSE(refined(few).reason.empty());
  EXPECT_FALSE(refined({}));
  EXPECT_FALSE(refined({}).reason.empty());
}

TEST(RefinePose, SurfacesThatRunAcrossTheModelDoNotCorrespond) {
  Fixture ball(scene::ball(0.05), 0.004);
  EXPECT_TRUE(ball.refine(ball.truth));
  for (auto& normal : ball.cluster.normals) normal = normal.unitOrthogonal();
  EXPECT_FALSE(ball.refine(ball.truth));
}

TEST(RefinePose, StopsAtTheLimitOfIterations) {
  RefineOptions options;
  const auto start = house().disturbed(4, {1, 1, 0}, {0.004, -0.003, 0.005});
  const auto free = house().refine(start, options);
  ASSERT_TRUE(free && free->converged);
  EXPECT_LT(free->iterations, options.max_iterations);
  for (const int limit : {1, 2, 3}) {
    options.max_iterations = limit;
    const auto stopped = house().refine(start, options);
    ASSERT_TRUE(stopped);
    EXPECT_EQ(stopped->iterations, limit);
    EXPECT_FALSE(stopped->converged);
  }
}

/// Points with much noise against a grid of coarse cells: ICP goes to and fro between pairs.
TEST(RefinePose, EndsWhereItComesBackToAPose) {
  const Fixture coarse(scene::cylinder(0.04, 0.1), 0.008);
  Surface few;
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 0.003f);
  for (std::size_t i = 0; i < coarse.cluster.size(); i += 13) {
    const auto& p = coarse.cluster.points[i];
    few.points.push_back(p + noise(random) * p.normalized());
    few.normals.push_back(coarse.cluster.normals[i]);
  }
  RefineOptions options;
  options.max_iterations = 200;
  options.start_distance = 0.01;
  options.max_distance = 0.006;
  int ended = 0;
  for (int k = 0; k < 20; ++k) {
    const Eigen::Vector3d axis(std::sin(k), std::cos(k), 0.3);
    const auto alignment =
        refinePose(few, coarse.grid, coarse.disturbed(4, axis, 0.004 * axis), options);
    ASSERT_TRUE(alignment);
    ended += alignment->converged;
  }
  EXPECT_EQ(ended, 20);
}

TEST(RefinePose, ACylinderDoesNotSpinAway) {
  const Fixture can(scene::cylinder(0.04, 0.12, 180), 0.004);
  const auto start = can.disturbed(4, {1, 1, 0}, {0.004, -0.003, 0.005});
  const auto alignment = can.refine(start);
  ASSERT_TRUE(alignment) << alignment.reason;
  const Eigen::Isometry3d off = can.truth.inverse() * alignment->T_camera_object;
  EXPECT_LT(std::acos(off.linear()(2, 2)) / DEG, 0.1);  // of the axis
  EXPECT_LT(off.translation().norm(), 0.0003);
  EXPECT_TRUE(alignment->converged);
  EXPECT_LT(angleOff(start, alignment->T_camera_object), 10);
}

TEST(RefinePose, ANoisyViewIsPlacedWithinAMillimetre) {
  const Mesh mesh = scene::house();
  const Eigen::Isometry3d truth = house().truth;
  for (const unsigned seed : {1, 2, 3}) {
    Cloud image = views::imageOf(mesh, truth);
    scene::addAxialNoise(image, 0.001, seed);
    const auto alignment =
        refinePose(views::sampled(image), house().grid,
                   house().disturbed(8, {1, -1, 1}, {0.008, 0, -0.006}), RefineOptions());
    ASSERT_TRUE(alignment) << alignment.reason;
    EXPECT_LT(farthestOff(house().model, alignment->T_camera_object, truth), 0.002);
    EXPECT_LT(angleOff(alignment->T_camera_object, truth), 0.7);
  }
}

TEST(RefinePose, OptionsOutOfRangeAreRefused) {
  EXPECT_EQ(clouds::refusalOf([] { house().refine(house().truth, byMethod("magic")); }),
            "refine.method must be one of point_to_plane, point_to_point, gicp, got 'magic'");
}
