#include "tabletop_perception/region_growing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "scene.h"
#include "tabletop_perception/normals.h"

using namespace tabletop_perception;
using clouds::refusalOf;

namespace {

const Eigen::Vector3f SENSOR = Eigen::Vector3f::Zero();

Normals normalsOf(const Cloud& cloud) {
  NormalsOptions options;
  options.step = 1;
  return computeNormals(cloud, SENSOR, options);
}

/// Objects without a table under them; pixels are 2 mm wide.
scene::SyntheticScene floating(const std::vector<scene::Standing>& objects) {
  scene::SceneOptions options;
  options.table_x = 0;
  return scene::render(objects, options);
}

constexpr double X = 0.12, Y = 0.10, Z = 0.14;  // sides of a box [m]

/// The face of that box that a point in its frame lies on: 0 to 5; -1 within 5 mm of an edge, or
/// where the face is seen from the side.
int faceAt(const Eigen::Vector3d& p, const Eigen::Vector3d& sensor) {
  const std::array<double, 6> distances{p.x() + X / 2, X / 2 - p.x(), p.y() + Y / 2,
                                        Y / 2 - p.y(), p.z(),         Z - p.z()};
  const auto near = [](double distance) { return std::abs(distance) < 0.005; };
  if (std::count_if(distances.begin(), distances.end(), near) != 1) return -1;
  const auto face = std::find_if(distances.begin(), distances.end(), near) - distances.begin();
  const double across = std::abs((sensor - p).normalized()[face / 2]);
  return across < 0.2 ? -1 : static_cast<int>(face);
}

/// Each of the given regions is one face of one of the objects, all boxes of X, Y, Z, and every
/// point inside a face that is seen well belongs to a region.
void expectFaces(const scene::SyntheticScene& scene, const std::vector<Indices>& regions) {
  std::vector<int> region_of(scene.cloud.size(), -1);
  for (std::size_t k = 0; k < regions.size(); ++k)
    for (const int i : regions[k]) region_of[i] = static_cast<int>(k);
  std::map<std::pair<std::uint32_t, int>, int> region_of_face;
  for (const int i : validIndices(scene.cloud)) {
    const auto& object = scene.objects[scene.truth[i] - 2];
    const Eigen::Isometry3d T_object_camera = object.T_camera_object.inverse();
    const int face = faceAt(T_object_camera * scene.cloud.point(i).cast<double>(),
                            T_object_camera.translation());
    if (face < 0) continue;
    const auto known = region_of_face.try_emplace({scene.truth[i], face}, region_of[i]).first;
    ASSERT_EQ(region_of[i], known->second) << "pixel " << i << " on face " << face;
    ASSERT_GE(region_of[i], 0) << "pixel " << i << " on face " << face;
  }
  std::vector<int> used;
  for (const auto& [face, region] : region_of_face) used.push_back(region);
  std::sort(used.begin(), used.end());
  EXPECT_TRUE(std::adjacent_find(used.begin(), used.end()) == used.end()) << "faces share a region";
  EXPECT_EQ(used.size(), regions.size());
}

/// Regions grown by looking at every pair of points, with `neighbors(i, j)`.
template <typename AreNeighbors>
std::vector<Indices> bruteForce(const Cloud& cloud, const Normals& normals,
                                const RegionGrowingOptions& options, AreNeighbors neighbors) {
  Indices left;
  for (const int i : validIndices(cloud))
    if (!std::isnan(normals.x[i])) left.push_back(i);
  const auto normal = [&](int i) {
    return Eigen::Vector3f(normals.x[i], normals.y[i], normals.z[i]);
  };
  const auto flat = [&](int i) { return normals.curvature[i] <= options.max_curvature; };
  const auto min_cosine = static_cast<float>(std::cos(options.smooth_angle_deg * M_PI / 180));
  std::vector<Indices> regions;
  while (true) {
    const auto seed = std::min_element(left.begin(), left.end(), [&](int a, int b) {
      return normals.curvature[a] < normals.curvature[b];
    });
    if (seed == left.end() || !flat(*seed)) break;
    Indices region{*seed};
    left.erase(seed);
    for (bool grown = true; grown;) {
      const auto joins = [&](int j) {
        return std::any_of(region.begin(), region.end(), [&](int i) {
          return flat(i) && neighbors(i, j) && normal(i).dot(normal(j)) >= min_cosine;
        });
      };
      const auto joining = std::find_if(left.begin(), left.end(), joins);
      grown = joining != left.end();
      if (!grown) continue;
      region.push_back(*joining);
      left.erase(joining);
    }
    std::sort(region.begin(), region.end());
    if (static_cast<int>(region.size()) >= options.min_points) regions.push_back(region);
  }
  std::sort(regions.begin(), regions.end(), [](const Indices& a, const Indices& b) {
    return a.size() != b.size() ? a.size() > b.size() : a < b;
  });
  return regions;
}

/// A row of `count` flat points a millimetre apart whose normals turn by `turn_deg` from one to
/// the next.
struct Row {
  Cloud cloud;
  Normals normals;
};
Row bentRow(int count, double turn_deg) {
  Row row{Cloud(count, 1, false), {}};
  for (int i = 0; i < count; ++i) {
    const double angle = i * turn_deg * M_PI / 180;
    row.cloud.setPoint(i, {0.001f * i, 0, 1});
    row.normals.x.push_back(static_cast<float>(std::sin(angle)));
    row.normals.y.push_back(0);
    row.normals.z.push_back(static_cast<float>(-std::cos(angle)));
    row.normals.curvature.push_back(0.001f);
  }
  return row;
}

RegionGrowingOptions rowOptions() {
  RegionGrowingOptions options;
  options.gap = 0.0015;
  options.min_points = 1;
  return options;
}

}  // namespace

TEST(RegionGrowing, ABoxIsItsThreeFaces) {
  const auto scene = floating({{"box", scene::box(X, Y, Z), scene::standing(0, 0, 0.6)}});
  const auto regions = growRegions(scene.cloud, normalsOf(scene.cloud), {});
  EXPECT_EQ(regions.size(), 3u);
  expectFaces(scene, regions);
}

TEST(RegionGrowing, WithoutTheGridABoxIsItsThreeFacesToo) {
  auto scene = floating({{"box", scene::box(X, Y, Z), scene::standing(0, 0, 0.6)}});
  const Normals normals = normalsOf(scene.cloud);
  RegionGrowingOptions options;
  options.gap = 0.005;
  const auto regions = growRegions(clouds::unorganised(scene.cloud), normals, options);
  EXPECT_EQ(regions.size(), 3u);
  expectFaces(scene, regions);
}

TEST(RegionGrowing, FacesOfTwoBoxesThatLieInOnePlaneStayApart) {
  const auto scene =
      floating({{"left", scene::box(X, Y, Z), scene::standing(0, Y / 2 + 0.01, 0)},
                {"right", scene::box(X, Y, Z), scene::standing(0, -Y / 2 - 0.01, 0)}});
  const Normals normals = normalsOf(scene.cloud);
  RegionGrowingOptions options;
  options.min_points = 600;  // the slivers of the sides between them have fewer
  for (const Cloud& cloud : {scene.cloud, clouds::unorganised(scene.cloud)}) {
    const auto regions = growRegions(cloud, normals, options);
    EXPECT_EQ(regions.size(), 4u);  // tops and fronts
    expectFaces(scene, regions);
  }
}

TEST(RegionGrowing, ABallIsOneRegionThoughItBends) {
  const auto scene = floating({{"ball", scene::ball(0.07), scene::standing(0, 0, 0)}});
  const auto regions = growRegions(scene.cloud, normalsOf(scene.cloud), {});
  ASSERT_GE(regions.size(), 1u);
  EXPECT_GT(regions[0].size(), 0.9 * validIndices(scene.cloud).size());
}

TEST(RegionGrowing, AngleIsTakenFromOneNeighbourToTheNext) {
  const Row row = bentRow(20, 4);
  auto options = rowOptions();
  options.smooth_angle_deg = 4.5;
  EXPECT_EQ(growRegions(row.cloud, row.normals, options).size(), 1u);
  options.smooth_angle_deg = 3.5;
  EXPECT_EQ(growRegions(row.cloud, row.normals, options).size(), 20u);
}

TEST(RegionGrowing, AnEdgeJoinsTheFlattestRegionThatReachesItAndEndsIt) {
  Row row = bentRow(11, 0);
  row.normals.curvature[5] = 0.2f;
  row.normals.curvature[8] = 0.0005f;  // the right side comes first
  const auto regions = growRegions(row.cloud, row.normals, rowOptions());
  EXPECT_EQ(regions, (std::vector<Indices>{{5, 6, 7, 8, 9, 10}, {0, 1, 2, 3, 4}}));
}

TEST(RegionGrowing, EdgesAloneAreNoRegion) {
  Row row = bentRow(5, 0);
  std::fill(row.normals.curvature.begin(), row.normals.curvature.end(), 0.2f);
  EXPECT_TRUE(growRegions(row.cloud, row.normals, rowOptions()).empty());
}

TEST(RegionGrowing, WithoutPointOrNormalThereIsNoRegion) {
  Row row = bentRow(6, 0);
  row.cloud.drop(2);
  row.normals.x[4] = row.normals.y[4] = row.normals.z[4] = row.normals.curvature[4] =
      clouds::NO_POINT;
  const auto regions = growRegions(row.cloud, row.normals, rowOptions());
  EXPECT_EQ(regions, (std::vector<Indices>{{0, 1}, {3}, {5}}));
}

TEST(RegionGrowing, SizesOutsideTheLimitsAreDropped) {
  Row row = bentRow(16, 0);
  row.cloud.drop(9);  // leaves 9 and 6 points
  auto options = rowOptions();
  options.min_points = 7;
  EXPECT_EQ(growRegions(row.cloud, row.normals, options).size(), 1u);
  options.min_points = 6;
  EXPECT_EQ(growRegions(row.cloud, row.normals, options).size(), 2u);
  options.max_points = 8;
  EXPECT_EQ(growRegions(row.cloud, row.normals, options).size(), 1u);
}

TEST(RegionGrowing, AreThoseOfTheBruteForceVersion) {
  std::mt19937 random(7);
  std::normal_distribution<float> turn(0, 0.12f);
  std::uniform_real_distribution<float> curvature(0, 0.045f);
  for (int round = 0; round < 10; ++round) {
    Cloud cloud(20, 12, false);
    Normals normals;
    const auto points = clouds::randomPoints(240, 0.004f, round + 1);
    for (int i = 0; i < 240; ++i) {
      cloud.setPoint(i, points[i] + 0.003f * Eigen::Vector3f(i % 20, i / 20, 0));
      if (random() % 8 == 0) cloud.drop(i);
      const Eigen::Vector3f normal = Eigen::Vector3f(turn(random), turn(random), -1).normalized();
      normals.x.push_back(normal.x());
      normals.y.push_back(normal.y());
      normals.z.push_back(normal.z());
      normals.curvature.push_back(curvature(random));
    }
    RegionGrowingOptions options;
    options.smooth_angle_deg = 8;
    options.gap = 0.007;
    options.min_points = 2;
    const auto near = [&](int i, int j) {
      return (cloud.point(i) - cloud.point(j)).norm() <= options.gap;
    };
    const auto side_by_side = [&](int i, int j) {
      return near(i, j) && std::abs(i % 20 - j % 20) <= 1 && std::abs(i / 20 - j / 20) <= 1;
    };
    const auto grid = growRegions(cloud, normals, options);
    EXPECT_EQ(grid, bruteForce(cloud, normals, options, side_by_side)) << "round " << round;
    EXPECT_GT(grid.size(), 3u);
    EXPECT_EQ(growRegions(clouds::unorganised(cloud), normals, options),
              bruteForce(cloud, normals, options, near))
        << "round " << round;
  }
}

TEST(RegionGrowing, NothingInNothingOut) {
  for (const Cloud& cloud : {Cloud(), Cloud(8, 6, false), Cloud(48, 1, false)})
    EXPECT_TRUE(growRegions(cloud, normalsOf(cloud), {}).empty());
}

TEST(RegionGrowing, OtherThanANormalPerPointIsRefused) {
  EXPECT_EQ(refusalOf([] { growRegions(Cloud(3, 1, false), bentRow(2, 0).normals, {}); }),
            "growRegions needs a normal per point, got 2 for 3 points");
  RegionGrowingOptions options;
  options.gap = 0;
  EXPECT_EQ(refusalOf([&] { growRegions(Cloud(), Normals(), options); }),
            "region_growing.gap must be between 0.001 and 0.2, got 0");
}
