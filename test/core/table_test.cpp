#include "tabletop_perception/table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "scene.h"

using namespace tabletop_perception;
using clouds::refusalOf;

namespace {

constexpr double DEG = M_PI / 180;

/// Three objects on a table of 0.6 x 0.7 m, all of it in view, with 2 mm of noise.
const scene::SyntheticScene& noisyScene() {
  static const scene::SyntheticScene noisy = [] {
    scene::SceneOptions options;
    options.noise = 0.002;
    options.table_x = 0.6;
    options.table_y = 0.7;
    return scene::threeObjects(options);
  }();
  return noisy;
}

/// A small table with a box on it, seen flatter than usual, and what stands about it.
scene::SyntheticScene tableAmid(const std::vector<scene::Standing>& surroundings) {
  scene::SceneOptions options;
  options.table_x = options.table_y = 0.5;
  options.pitch_deg = 30;
  std::vector<scene::Standing> all{{"box", scene::box(0.1, 0.1, 0.15), scene::standing(0, 0, 0.5)}};
  all.insert(all.end(), surroundings.begin(), surroundings.end());
  return scene::render(all, options);
}

scene::Standing wall() {
  return {"wall", scene::moved(scene::box(0.02, 5, 5), 0.5, 0, -2.5), scene::standing(0, 0, 0)};
}

scene::Standing floorBelow() {
  return {"floor", scene::moved(scene::box(8, 8, 0.02), 0, 0, -0.72), scene::standing(0, 0, 0)};
}

scene::Standing boxOnTheFloor() {
  return {"crate", scene::moved(scene::box(0.2, 0.2, 0.3), 0.3, 0.7, -0.7),
          scene::standing(0, 0, 0)};
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

void expectPlane(const Table& table, const Eigen::Vector4d& truth, double angle_deg,
                 double distance) {
  EXPECT_NEAR(table.plane.head<3>().norm(), 1, 1e-9);
  EXPECT_LT(angleBetween(table.plane.head<3>(), truth.head<3>()) / DEG, angle_deg);
  for (const auto& corner : hullInCamera(table))
    EXPECT_NEAR(truth.head<3>().dot(corner) + truth[3], 0, 2 * distance) << "at a corner";
  EXPECT_NEAR(truth.head<3>().dot(table.T_camera_table.translation()) + truth[3], 0, distance);
}

double areaOf(const std::vector<Eigen::Vector2d>& hull) {
  double twice = 0;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const auto &a = hull[i], &b = hull[(i + 1) % hull.size()];
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return twice / 2;
}

/// A table about which nothing is special: turned and shifted, its hull 0.4 x 0.2 m.
Table turnedTable() {
  Table table;
  table.T_camera_table = clouds::motion(130, {1, 0.3, -0.2}, {0.1, -0.2, 0.9});
  const Eigen::Vector3d normal = table.T_camera_table.linear().col(2);
  table.plane << normal, -normal.dot(table.T_camera_table.translation());
  table.hull = {{-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.1}, {-0.2, 0.1}};
  return table;
}

}  // namespace

TEST(Table, IsFoundExactlyAmongNoiseAndObjects) {
  const auto& scene = noisyScene();
  for (const auto& up :
       {std::optional<Eigen::Vector3d>(scene.up), std::optional<Eigen::Vector3d>()})
    for (const int seed : {1, 2, 3}) {
      TableOptions options;
      options.seed = seed;
      const auto table = findTable(scene.cloud, up, options);
      ASSERT_TRUE(table) << table.reason;
      EXPECT_EQ(table.reason, "");
      expectPlane(*table, scene.plane, 0.05, 0.0005);
      EXPECT_NEAR(table->rms, 0.002 * std::sin(40 * DEG), 0.0004);
    }
}

TEST(Table, ItsInliersAreThePixelsOfTheTable) {
  const auto& scene = noisyScene();
  const auto table = findTable(scene.cloud, scene.up, TableOptions());
  ASSERT_TRUE(table);
  const auto is_table = [&](int i) { return scene.truth[i] == 1; };
  const auto& inliers = table->inliers;
  EXPECT_TRUE(std::is_sorted(inliers.begin(), inliers.end()));
  const double right = std::count_if(inliers.begin(), inliers.end(), is_table);
  int all = 0;  // of the surface, without the table's sides
  for (std::size_t i = 0; i < scene.cloud.size(); ++i)
    all += scene.truth[i] == 1 &&
           std::abs(scene.plane.head<3>().dot(scene.cloud.point(i).cast<double>()) +
                    scene.plane[3]) < 0.008;
  EXPECT_GT(right / inliers.size(), 0.98);  // the feet of objects lie in the band as well
  EXPECT_GT(right / all, 0.98);
  for (const int i : inliers)
    ASSERT_LE(std::abs(heightAbove(*table, scene.cloud.point(i))), TableOptions().distance);
}

TEST(Table, ItsHullIsConvexCounterClockwiseAndHoldsTheInliers) {
  // To within 8 mm: the hull's corners are points as well, and as noisy; containment is tabulated.
  const auto& scene = noisyScene();
  const auto table = findTable(scene.cloud, scene.up, TableOptions());
  ASSERT_TRUE(table);
  const auto& hull = table->hull;
  ASSERT_GE(hull.size(), 4u);
  const auto leftOf = [&](std::size_t i, const Eigen::Vector2d& p) {
    const Eigen::Vector2d edge = hull[(i + 1) % hull.size()] - hull[i], d = p - hull[i];
    return (edge.x() * d.y() - edge.y() * d.x()) / edge.norm();
  };
  for (std::size_t i = 0; i < hull.size(); ++i) {
    EXPECT_GT(leftOf(i, hull[(i + 2) % hull.size()]), 0) << "corner " << i;
    EXPECT_GT((hull[(i + 1) % hull.size()] - hull[i]).norm(), 1e-6);
  }
  for (const int k : table->inliers) {
    const Eigen::Vector3d p = table->T_camera_table.inverse() * scene.cloud.point(k).cast<double>();
    for (std::size_t i = 0; i < hull.size(); ++i) ASSERT_GE(leftOf(i, p.head<2>()), -0.008);
  }
  EXPECT_NEAR(areaOf(hull), 0.6 * 0.7, 0.02);
}

TEST(Table, ItsFrameHasZOutOfItAndXForward) {
  const auto& scene = noisyScene();
  const auto table = findTable(scene.cloud, scene.up, TableOptions());
  ASSERT_TRUE(table);
  const Eigen::Matrix3d R = table->T_camera_table.linear();
  EXPECT_NEAR(R.determinant(), 1, 1e-9);
  EXPECT_TRUE((R.transpose() * R).isIdentity(1e-9));
  EXPECT_NEAR((R.col(2) - table->plane.head<3>()).norm(), 0, 1e-9);
  EXPECT_NEAR(heightAbove(*table, table->T_camera_table.translation().cast<float>()), 0, 1e-6);
  const Eigen::Isometry3d off = scene.T_camera_table.inverse() * table->T_camera_table;
  EXPECT_LT(angleBetween(off.linear().col(0), Eigen::Vector3d::UnitX()) / DEG, 2);
  EXPECT_LT(off.translation().norm(), 0.01);  // the middle of the table
}

TEST(Table, TurnsWithTheSceneIntoACameraThatLooksAlongNegativeZ) {
  const auto& scene = noisyScene();
  const Eigen::Isometry3d T = clouds::motion(180, Eigen::Vector3d::UnitX(), {0, 0, 0});
  for (const bool with_up : {true, false}) {
    const auto up = [&](const Eigen::Vector3d& u) {
      return with_up ? std::optional<Eigen::Vector3d>(u) : std::nullopt;
    };
    const auto table = findTable(scene.cloud, up(scene.up), TableOptions());
    const auto turned =
        findTable(clouds::turned(scene.cloud, T), up(T.linear() * scene.up), TableOptions());
    ASSERT_TRUE(table && turned) << turned.reason;
    EXPECT_TRUE((T * table->T_camera_table).isApprox(turned->T_camera_table, 1e-4));
    EXPECT_TRUE(turned->plane.head<3>().isApprox(T.linear() * table->plane.head<3>(), 1e-5));
    EXPECT_NEAR(turned->plane[3], table->plane[3], 1e-5);
    EXPECT_NEAR(areaOf(turned->hull), areaOf(table->hull), 1e-4);
  }
}

TEST(Table, TurnsWithTheSceneIntoAnyFrame) {
  const auto& scene = noisyScene();
  const Eigen::Isometry3d T = clouds::motion(77, {0.3, -1, 0.4}, {0, 0, 0});
  const auto turned =
      findTable(clouds::turned(scene.cloud, T), T.linear() * scene.up, TableOptions());
  ASSERT_TRUE(turned) << turned.reason;
  Eigen::Vector4d plane = scene.plane;
  plane.head<3>() = T.linear() * scene.plane.head<3>();
  expectPlane(*turned, plane, 0.05, 0.0005);
  const Eigen::Isometry3d off = (T * scene.T_camera_table).inverse() * turned->T_camera_table;
  EXPECT_LT(angleOf(off.linear()) / DEG, 2);
  EXPECT_LT(off.translation().norm(), 0.01);
}

TEST(Table, SameInputSameBits) {
  const auto& scene = noisyScene();
  const auto once = findTable(scene.cloud, scene.up, TableOptions());
  const auto again = findTable(scene.cloud, scene.up, TableOptions());
  ASSERT_TRUE(once && again);
  EXPECT_EQ(once->plane, again->plane);
  EXPECT_EQ(once->T_camera_table.matrix(), again->T_camera_table.matrix());
  EXPECT_EQ(once->hull, again->hull);
  EXPECT_EQ(once->inliers, again->inliers);
  EXPECT_EQ(once->rms, again->rms);
}

TEST(Table, IsFoundAmongPixelsWithoutDepthAndWithoutAGrid) {
  scene::SyntheticScene scene = noisyScene();
  std::mt19937 random(5);
  for (std::size_t i = 0; i < scene.cloud.size(); ++i)
    if (random() % 3 == 0) scene.cloud.drop(i);
  const auto table = findTable(scene.cloud, scene.up, TableOptions());
  ASSERT_TRUE(table) << table.reason;
  expectPlane(*table, scene.plane, 0.05, 0.0005);
  for (const int i : table->inliers) ASSERT_TRUE(scene.cloud.valid(i));

  const Cloud packed = selectPoints(scene.cloud, validIndices(scene.cloud));
  const auto unorganised = findTable(packed, scene.up, TableOptions());
  ASSERT_TRUE(unorganised) << unorganised.reason;
  TableOptions drawing;
  drawing.method = "ransac";  // as without a grid
  const auto drawn = findTable(scene.cloud, scene.up, drawing);
  ASSERT_TRUE(drawn) << drawn.reason;
  EXPECT_TRUE(unorganised->plane.isApprox(drawn->plane, 1e-5));  // summed in another order
}

TEST(Table, ALargerWallIsNoTableWhenUpIsKnown) {
  const auto scene = tableAmid({wall()});
  const auto count = [&](std::uint32_t label) {
    return std::count(scene.truth.begin(), scene.truth.end(), label);
  };
  ASSERT_GT(count(3), 2 * count(1)) << "the wall is meant to be the larger";
  TableOptions options;
  const auto table = findTable(scene.cloud, scene.up, options);
  ASSERT_TRUE(table) << table.reason;
  expectPlane(*table, scene.plane, 0.05, 0.0005);

  options.max_planes = 1;
  const auto none = findTable(scene.cloud, scene.up, options);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.reason, "largest plane is 90 deg from up, limit 20");
}

TEST(Table, ATiltWithinTheLimitIsATable) {
  const auto tilted = [](const scene::SyntheticScene& scene, double degrees) {
    const Eigen::Vector3d across = scene.T_camera_table.linear().col(1);
    TableOptions options;
    options.max_tilt_deg = 10;
    const Eigen::Vector3d up = Eigen::AngleAxisd(degrees * DEG, across) * scene.up;
    return findTable(scene.cloud, up, options);
  };
  scene::SceneOptions options;
  options.noise = 0.002;
  const auto bare = scene::render({}, options);
  EXPECT_TRUE(tilted(bare, 9));
  const auto none = tilted(bare, 12);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.reason, "largest plane is 12 deg from up, limit 10");

  // Nor does a slanting plane through the refused table and its objects become one.
  for (const double degrees : {12, 15, 25, 40}) {
    const auto table = tilted(noisyScene(), degrees);
    if (!table) continue;
    const auto refused = std::count_if(table->inliers.begin(), table->inliers.end(),
                                       [](int i) { return noisyScene().truth[i] == 1; });
    EXPECT_LT(refused, 0.01 * table->inliers.size()) << degrees << " deg";
  }
}

TEST(Table, TheHeightBandExcludesTheFloor) {
  const auto scene = tableAmid({floorBelow(), boxOnTheFloor()});
  TableOptions options;
  options.max_planes = 1;
  const auto floor = findTable(scene.cloud, scene.up, options);
  ASSERT_TRUE(floor) << floor.reason;
  EXPECT_NEAR(floor->plane[3] - scene.plane[3], 0.7, 0.002) << "the floor is the larger";

  options.use_height_band = true;
  options.min_table_height = -0.8;
  options.max_table_height = -0.1;
  options.max_planes = TableOptions().max_planes;
  const auto table = findTable(scene.cloud, scene.up, options);
  ASSERT_TRUE(table) << table.reason;
  expectPlane(*table, scene.plane, 0.05, 0.0005);

  options.max_planes = 1;
  const auto none = findTable(scene.cloud, scene.up, options);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.reason, "largest level plane is at height -1.15 m, limits -0.80 to -0.10");
}

TEST(Table, CarriesSomethingOrIsNotPreferred) {
  // The floor is larger; the table lies higher than things that stand on the floor may.
  const auto scene = tableAmid({floorBelow()});
  for (const auto& up :
       {std::optional<Eigen::Vector3d>(scene.up), std::optional<Eigen::Vector3d>()}) {
    const auto table = findTable(scene.cloud, up, TableOptions());
    ASSERT_TRUE(table) << table.reason;
    EXPECT_EQ(table.reason, "");
    expectPlane(*table, scene.plane, 0.05, 0.0005);
  }
}

TEST(Table, StandsOverAFloorThatCarriesSomethingToo) {
  const auto scene = tableAmid({floorBelow(), boxOnTheFloor()});
  const Cloud packed = selectPoints(scene.cloud, validIndices(scene.cloud));
  for (const Cloud* cloud : {&scene.cloud, &packed})
    for (const auto& up :
         {std::optional<Eigen::Vector3d>(scene.up), std::optional<Eigen::Vector3d>()}) {
      const auto tables = findTables(*cloud, up, TableOptions());
      ASSERT_TRUE(tables) << tables.reason;
      ASSERT_EQ(tables->size(), 1u) << "the floor is none";
      expectPlane(tables->front(), scene.plane, 0.05, 0.0005);
    }
}

TEST(Table, ABarePlaneIsATableOnWhichNothingStands) {
  const auto scene = scene::render({});
  for (const auto& up :
       {std::optional<Eigen::Vector3d>(scene.up), std::optional<Eigen::Vector3d>()}) {
    const auto table = findTable(scene.cloud, up, TableOptions());
    ASSERT_TRUE(table);
    EXPECT_EQ(table.reason, "nothing stands on it");
    expectPlane(*table, scene.plane, 0.05, 0.0005);
  }
}

TEST(Table, PartsThatShadowsCutOffBelongToItAndSpecksInItsPlaneDoNot) {
  scene::SceneOptions options;
  options.table_x = options.table_y = 0;
  const auto part = [](double x, double y, double at) {
    return scene::Standing{"part", scene::moved(scene::box(x, y, 0.02), 0, 0, -0.02),
                           scene::standing(0, at, 0)};
  };
  const auto scene =
      scene::render({part(0.4, 0.4, -0.2), part(0.4, 0.1, 0.15), part(0.05, 0.05, 0.4)}, options);
  const auto table = findTable(scene.cloud, scene.up, TableOptions());
  ASSERT_TRUE(table);
  EXPECT_NEAR(areaOf(table->hull), 0.4 * 0.6, 0.01);
  for (const int i : table->inliers) ASSERT_TRUE(scene.truth[i] == 2 || scene.truth[i] == 3);
}

TEST(Table, NothingFoundHasItsReason) {
  const auto reasonFor = [](const Cloud& cloud) {
    const auto table = findTable(cloud, std::nullopt, TableOptions());
    EXPECT_FALSE(table);
    return table.reason;
  };
  EXPECT_EQ(reasonFor(Cloud(64, 48, false)), "the cloud has no valid point");
  EXPECT_EQ(reasonFor(Cloud()), "the cloud has no valid point");
  EXPECT_EQ(reasonFor(clouds::cloudOf({{0, 0, 1}, {1, 0, 1}})), "no plane");
  const auto line = [] {
    std::vector<Eigen::Vector3f> points;
    for (int i = 0; i < 5000; ++i) points.emplace_back(i * 0.001f, 0, 1);
    return points;
  }();
  EXPECT_EQ(reasonFor(clouds::cloudOf(line)), "no plane");
  const auto fog = reasonFor(clouds::cloudOf(clouds::randomPoints(5000, 0.5f, 1)));
  int points = 0;
  ASSERT_EQ(std::sscanf(fog.c_str(), "largest plane has %d points, limit 2000", &points), 1) << fog;
  EXPECT_GT(points, 50);
  EXPECT_LT(points, 500);
}

TEST(Table, IsFoundThroughTheNoiseOfAPoorCamera) {
  scene::SceneOptions options;
  options.noise = 0.008;
  const auto scene = scene::threeObjects(options);
  for (const std::string method : {"components", "ransac"}) {
    TableOptions table_options;
    table_options.method = method;
    const auto table = findTable(scene.cloud, scene.up, table_options);
    ASSERT_TRUE(table) << method << ": " << table.reason;
    expectPlane(*table, scene.plane, 0.1, 0.001);
  }
}

TEST(Table, AWallAFloorOrACeilingAloneIsNone) {
  scene::SceneOptions none_of_it;
  none_of_it.table_x = none_of_it.table_y = 0;
  const auto ceiling = scene::Standing{"ceiling", scene::moved(scene::box(8, 8, 0.02), 0, 0, 1.2),
                                       scene::standing(0, 0, 0)};
  auto upwards = none_of_it;
  upwards.pitch_deg = -20;  // the camera, 0.31 m below the origin, looks up
  TableOptions options;
  options.use_height_band = true;
  options.min_table_height = -0.8;
  options.max_table_height = -0.1;
  for (const std::string method : {"components", "ransac"}) {
    options.method = method;
    const auto reasonFor = [&](const scene::Standing& thing, const scene::SceneOptions& view) {
      const auto scene = scene::render({thing}, view);
      const auto table = findTable(scene.cloud, scene.up, options);
      EXPECT_FALSE(table) << thing.name << ", " << method;
      return table.reason;
    };
    EXPECT_EQ(reasonFor(wall(), none_of_it), "largest plane is 90 deg from up, limit 20");
    EXPECT_EQ(reasonFor(floorBelow(), none_of_it),
              "largest level plane is at height -1.28 m, limits -0.80 to -0.10");
    EXPECT_EQ(reasonFor(ceiling, upwards),
              "largest level plane is at height 1.51 m, seen from below");
    const auto nothing = findTable(Cloud(640, 480, false), Eigen::Vector3d(0, -1, 0), options);
    EXPECT_EQ(nothing.reason, "the cloud has no valid point");
  }
}

TEST(Table, IsNoCutThroughABall) {
  scene::SceneOptions options;
  options.table_x = options.table_y = 0;
  options.distance = 0.6;
  const auto scene =
      scene::render({{"ball", scene::ball(0.12), scene::standing(0, 0, 0)}}, options);
  for (const std::string method : {"components", "ransac"})
    for (const auto& up :
         {std::optional<Eigen::Vector3d>(scene.up), std::optional<Eigen::Vector3d>()}) {
      TableOptions table_options;
      table_options.method = method;
      const auto table = findTable(scene.cloud, up, table_options);
      EXPECT_FALSE(table) << method;
      EXPECT_NE(table.reason, "");
      if (method == "components") continue;
      const auto points = selectPoints(scene.cloud, validIndices(scene.cloud));
      const auto unorganised = findTable(points, up, table_options);
      EXPECT_FALSE(unorganised);
      EXPECT_NE(unorganised.reason.find("of its normals agree"), std::string::npos)
          << unorganised.reason;
    }
}

TEST(Table, AWrongUpDirectionGivesNone) {
  const auto& scene = noisyScene();
  const Cloud packed = selectPoints(scene.cloud, validIndices(scene.cloud));
  TableOptions drawing;
  drawing.method = "ransac";
  for (const auto axis : {0, 1})
    for (const double degrees : {-35, 35, 50}) {
      const Eigen::Vector3d across = scene.T_camera_table.linear().col(axis);
      const Eigen::Vector3d up = Eigen::AngleAxisd(degrees * DEG, across) * scene.up;
      for (const auto& table :
           {findTable(scene.cloud, up, TableOptions()), findTable(scene.cloud, up, drawing),
            findTable(packed, up, TableOptions())}) {
        EXPECT_FALSE(table) << degrees << " deg about axis " << axis;
        char reason[100];
        std::snprintf(reason, sizeof reason, "largest plane is %.0f deg from up, limit 20",
                      std::abs(degrees));
        EXPECT_EQ(table.reason, reason);
      }
    }
}

TEST(Table, ShelfBoardsAreSeveralTablesTheMainOneFirst) {
  const auto board = scene::Standing{"board", scene::moved(scene::box(0.5, 0.5, 0.02), 0, 0.6, 0.1),
                                     scene::standing(0, 0, 0)};
  const auto on_it = scene::Standing{"box", scene::moved(scene::box(0.1, 0.1, 0.1), 0, 0.6, 0.12),
                                     scene::standing(0, 0, 0)};
  const auto scene = tableAmid({board, on_it});
  const auto tables = findTables(scene.cloud, scene.up, TableOptions());
  ASSERT_TRUE(tables) << tables.reason;
  ASSERT_EQ(tables->size(), 2u);
  expectPlane(tables->front(), scene.plane, 0.05, 0.0005);
  EXPECT_NEAR(scene.plane[3] - tables->back().plane[3], 0.12, 0.001);
  const auto one = findTable(scene.cloud, scene.up, TableOptions());
  ASSERT_TRUE(one);
  EXPECT_EQ(one->plane, tables->front().plane);
}

TEST(Table, ABoardAboveItIsAnotherAndTheTopOfAThingIsNone) {
  scene::SceneOptions options;
  options.table_x = 0.8;
  options.table_y = 0.9;
  const scene::Standing can{"can", scene::moved(scene::cylinder(0.04, 0.1), 0.2, 0.1, 0.2),
                            scene::standing(0, 0, 0)};
  const auto sceneWith = [&](double bottom) {
    const scene::Standing thing{"thing",
                                scene::moved(scene::box(0.5, 0.7, 0.2 - bottom), 0.1, 0, bottom),
                                scene::standing(0, 0, 0)};
    return scene::render({thing, can}, options);
  };
  const auto shelf = sceneWith(0.18), block = sceneWith(0);
  const auto boards = findTables(shelf.cloud, shelf.up, TableOptions());
  ASSERT_TRUE(boards) << boards.reason;
  ASSERT_EQ(boards->size(), 2u);
  EXPECT_NEAR(shelf.plane[3] - boards->back().plane[3], 0.2, 0.001);
  const auto tables = findTables(block.cloud, block.up, TableOptions());
  ASSERT_TRUE(tables) << tables.reason;
  EXPECT_EQ(tables->size(), 1u);
  expectPlane(tables->front(), block.plane, 0.05, 0.0005);

  // Only the can stands on the shelf, not the board above the table; a block of that size is a
  // thing.
  const auto labelsOn = [](const scene::SyntheticScene& scene, const std::vector<Table>& on) {
    const Cloud standing = pointsOnTables(scene.cloud, on, TableOptions());
    std::vector<int> counts(4, 0);
    for (const int i : validIndices(standing)) ++counts[scene.truth[i]];
    return counts;
  };
  const auto on_boards = labelsOn(shelf, *boards), on_table = labelsOn(block, *tables);
  EXPECT_EQ(on_boards[2], 0);
  EXPECT_GT(on_boards[3], 1000);
  EXPECT_GT(on_table[2], 10000);
}

TEST(Table, UpFollowsFromTheCamerasPitch) {
  EXPECT_TRUE(upOfPitch(0).isApprox(Eigen::Vector3d(0, -1, 0)));
  EXPECT_TRUE(upOfPitch(90).isApprox(Eigen::Vector3d(0, 0, -1)));  // looks straight down
  const double half = std::sqrt(0.5);
  EXPECT_TRUE(upOfPitch(45).isApprox(Eigen::Vector3d(0, -half, -half)));
}

TEST(Table, OptionsOutOfRangeAreRefused) {
  TableOptions options;
  options.max_tilt_deg = 100;
  EXPECT_EQ(refusalOf([&] { findTable(Cloud(), std::nullopt, options); }),
            "table.max_tilt_deg must be between 0 and 90, got 100");
}

TEST(Table, WhatStandsOnItLiesInTheHeightBandAboveTheHull) {
  const Table table = turnedTable();
  const auto inTable = clouds::randomPoints(3000, 0.4f, 8);
  Cloud cloud(60, 50, false);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (i % 5 != 0)
      cloud.setPoint(i, (table.T_camera_table * inTable[i].cast<double>()).cast<float>());
  for (const double margin : {0.0, -0.05}) {
    TableOptions options;
    options.min_height = 0.02;
    options.max_height = 0.25;
    options.hull_margin = margin;
    const Cloud standing = pointsOnTables(cloud, {table}, options);
    EXPECT_EQ(standing.width, 60);
    EXPECT_EQ(standing.height, 50);
    int stand = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const auto& p = inTable[i];
      const bool stands = cloud.valid(i) && p.z() >= 0.02f && p.z() <= 0.25f &&
                          std::abs(p.x()) <= 0.2 + margin && std::abs(p.y()) <= 0.1 + margin;
      ASSERT_EQ(standing.valid(i), stands) << p.transpose() << ", margin " << margin;
      stand += stands;
    }
    EXPECT_GT(stand, 20);
  }
}

TEST(Table, ThingsAtTheEdgeOfThePictureStandOnItWhole) {
  // A box so near that its foot is below the picture: no table is seen in front of it.
  const auto scene =
      scene::render({{"box", scene::box(0.1, 0.2, 0.2), scene::standing(-0.31, 0, 0)}});
  const auto table = findTable(scene.cloud, scene.up, {});
  ASSERT_TRUE(table) << table.reason;
  const Cloud standing = pointsOnTables(scene.cloud, {*table}, {});
  int above = 0, lost = 0;
  for (std::size_t i = 0; i < scene.cloud.size(); ++i) {
    if (scene.truth[i] != 2 || heightAbove(*table, scene.cloud.point(i)) < 0.01f) continue;
    ++above;
    lost += !standing.valid(i);
  }
  EXPECT_GT(above, 10000);
  EXPECT_EQ(lost, 0);
}

TEST(Table, NothingStandsBeyondAnEdgeThatIsInThePicture) {
  // A crate that stands on the floor behind the table and is higher than it.
  const auto scene = tableAmid(
      {{"crate", scene::box(0.2, 0.2, 1), Eigen::Isometry3d(Eigen::Translation3d(0.46, 0, -0.7))}});
  const auto table = findTable(scene.cloud, scene.up, {});
  ASSERT_TRUE(table) << table.reason;
  const Cloud standing = pointsOnTables(scene.cloud, {*table}, {});
  int of_box = 0, of_crate = 0;
  for (const int i : validIndices(standing)) {
    of_box += scene.truth[i] == 2;
    of_crate += scene.truth[i] == 3;
  }
  EXPECT_GT(of_box, 1000);
  EXPECT_EQ(of_crate, 0);
}

TEST(Table, AMarginCountsFromTheEdges) {
  const Table table = turnedTable();
  TableOptions options;
  options.hull_margin = 0.05;
  const auto stands = [&](double x, double y) {
    const Eigen::Vector3d p = table.T_camera_table * Eigen::Vector3d(x, y, 0.1);
    return !validIndices(pointsOnTables(clouds::cloudOf({p.cast<float>()}), {table}, options))
                .empty();
  };
  EXPECT_TRUE(stands(0.24, 0));
  EXPECT_FALSE(stands(0.26, 0));
  EXPECT_TRUE(stands(0, -0.14));
  EXPECT_FALSE(stands(0, -0.16));
}
