#include "tabletop_perception/planes.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "scene.h"

using namespace tabletop_perception;
using clouds::refusalOf;

namespace {

/// A scene at a quarter of the usual resolution: every pixel counts.
scene::SceneOptions coarse() {
  scene::SceneOptions options;
  options.projection = {131.25, 131.25, 79.5, 59.5, 160, 120, 1};
  options.noise = 0.001;
  return options;
}

std::vector<Plane> planesIn(const Cloud& cloud, const PlaneOptions& options = {}) {
  NormalsOptions at_every_pixel;
  at_every_pixel.step = 1;
  return findPlanes(cloud, computeNormals(cloud, Eigen::Vector3f::Zero(), at_every_pixel), options);
}

double offBy(const Plane& plane, const Eigen::Vector4d& truth) {
  return std::acos(std::min(1.0, plane.plane.head<3>().dot(truth.head<3>()))) * 180 / M_PI;
}

}  // namespace

TEST(Planes, ATableAndABoxOnItAreSeveral) {
  const auto scene =
      scene::render({{"box", scene::box(0.3, 0.3, 0.2), scene::standing(0, 0, 0)}}, coarse());
  const auto planes = planesIn(scene.cloud);
  ASSERT_EQ(planes.size(), 3u);  // the table, the box's lid and its front
  EXPECT_LT(offBy(planes[0], scene.plane), 0.2);
  EXPECT_NEAR(planes[0].plane[3], scene.plane[3], 0.001);
  const auto lid = std::find_if(planes.begin() + 1, planes.end(),
                                [&](const Plane& p) { return offBy(p, scene.plane) < 1; });
  ASSERT_NE(lid, planes.end());
  EXPECT_NEAR(scene.plane[3] - lid->plane[3], 0.2, 0.002);
  for (const auto& plane : planes) {
    EXPECT_TRUE(std::is_sorted(plane.points.begin(), plane.points.end()));
    EXPECT_LE(plane.points.size(), planes[0].points.size());
    EXPECT_LT(plane.rms, 0.002);
    EXPECT_LT(plane.plane.head<3>().dot(plane.centroid), 0) << "faces the camera";
  }
}

TEST(Planes, NoPointIsOnTwo) {
  const auto scene = scene::threeObjects(coarse());
  std::vector<int> uses(scene.cloud.size(), 0);
  for (const auto& plane : planesIn(scene.cloud))
    for (const int i : plane.points) ++uses[i];
  EXPECT_EQ(*std::max_element(uses.begin(), uses.end()), 1);
}

TEST(Planes, ABallHasNone) {
  auto options = coarse();
  options.table_x = options.table_y = 0;
  const auto scene =
      scene::render({{"ball", scene::ball(0.25), scene::standing(0, 0, 0)}}, options);
  ASSERT_GT(validIndices(scene.cloud).size(), 2000u);
  EXPECT_TRUE(planesIn(scene.cloud).empty());
}

TEST(Planes, SmallOnesAreDropped) {
  const auto scene = scene::threeObjects(coarse());
  PlaneOptions options;
  options.min_points = 5000;
  for (const auto& plane : planesIn(scene.cloud, options)) EXPECT_GE(plane.points.size(), 5000u);
  EXPECT_LT(planesIn(scene.cloud, options).size(), planesIn(scene.cloud).size());
}

TEST(Planes, ThereAreNoneWithoutAGridOrPoints) {
  EXPECT_TRUE(planesIn(clouds::cloudOf(clouds::randomPoints(200, 0.5f, 1))).empty());
  EXPECT_TRUE(planesIn(Cloud(64, 48, false)).empty());
}

TEST(Planes, MergedTheyLieBetween) {
  const auto at = [](float z) {
    Cloud cloud(20, 20, false);
    for (int i = 0; i < 400; ++i)
      cloud.setPoint(i, {0.01f * (i % 20), 0.01f * (i / 20), i / 20 < 10 ? 1.0f : z});
    return cloud;
  };
  const Cloud cloud = at(1.004f);
  Plane a, b;
  a.plane = b.plane = {0, 0, -1, 1};
  for (int i = 0; i < 400; ++i) (i / 20 < 5 || i / 20 >= 15 ? a : b).points.push_back(i);
  const Plane both = mergedPlane(cloud, a, b);
  EXPECT_EQ(both.points.size(), 400u);
  EXPECT_NEAR(both.centroid.z(), 1.002, 1e-5);
  EXPECT_LT(both.plane[2], -0.9) << "faces as they do";
}

TEST(Planes, TheLargestIsFoundWithAllItsPointsWhetherThereIsAGridOrNot) {
  const auto scene = scene::threeObjects(coarse());
  const Cloud listed = selectPoints(scene.cloud, validIndices(scene.cloud));
  for (const Cloud& cloud : {scene.cloud, listed}) {
    const auto plane = findLargestPlane(cloud, 0.01, std::nullopt, 1);
    ASSERT_TRUE(plane);
    EXPECT_LT(offBy(*plane, scene.plane), 0.1);
    EXPECT_LT(plane->rms, 0.002);
    std::size_t near = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i)
      near += cloud.valid(i) && std::abs(plane->plane.head<3>().dot(cloud.point(i).cast<double>()) +
                                         plane->plane[3]) <= 0.01;
    EXPECT_NEAR(static_cast<double>(plane->points.size()), static_cast<double>(near), 2);
  }
}

TEST(Planes, TheLargestMeetsItsConstraint) {
  const auto scene = scene::threeObjects(coarse());
  const Eigen::Vector3d across = scene.plane.head<3>().unitOrthogonal();
  const auto plane = findLargestPlane(scene.cloud, 0.01, PlaneConstraint{across, 0.9}, 1);
  ASSERT_TRUE(plane);
  EXPECT_GT(std::abs(plane->plane.head<3>().dot(across)), 0.85);  // drawn within 0.9
}

TEST(Planes, TheLargestOfTooFewPointsIsNone) {
  EXPECT_FALSE(findLargestPlane(Cloud(), 0.01, std::nullopt, 1));
  EXPECT_FALSE(findLargestPlane(Cloud(40, 30, false), 0.01, std::nullopt, 1));
  EXPECT_FALSE(findLargestPlane(clouds::cloudOf({{0, 0, 1}, {0.1f, 0, 1}}), 0.01, std::nullopt, 1));
}

TEST(Planes, OptionsOutOfRangeAreRefused) {
  PlaneOptions options;
  options.max_offset = 0;
  EXPECT_EQ(refusalOf([&] { findPlanes(Cloud(), Normals(), options); }),
            "planes.max_offset must be between 0.0001 and 1, got 0");
}
