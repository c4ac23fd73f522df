#include "tabletop_perception/pick.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "clouds.h"
#include "scene.h"
#include "tabletop_perception/pick_scene.h"

namespace tabletop_perception {
namespace {

/// A box of 12 x 6 x 10 cm alone on a table.
scene::SyntheticScene boxOnTable() {
  return scene::render({{"box", scene::box(0.12, 0.06, 0.10), scene::standing(0, 0, 0.3)}});
}

Eigen::Vector3f inCamera(const scene::SyntheticScene& scene, const Eigen::Vector3d& in_table) {
  return (scene.T_camera_table * in_table).cast<float>();
}

Found<Pick> pickAt(const scene::SyntheticScene& scene, const Eigen::Vector3d& in_table) {
  return pickInScene(scene.cloud, inCamera(scene, in_table), scene.up, PipelineOptions());
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

double cosine(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return a.dot(b); }

TEST(Pick, theThingAtAPointIsTaken) {
  const auto scene =
      scene::render({{"box", scene::box(0.12, 0.06, 0.10), scene::standing(0, 0.03, 0)},
                     {"other box", scene::box(0.08, 0.06, 0.10), scene::standing(0, -0.05, 0)},
                     {"can", scene::cylinder(0.035, 0.12), scene::standing(0.1, 0.2, 0)}});
  for (std::size_t k = 0; k < scene.objects.size(); ++k) {
    Indices truth;
    for (std::size_t i = 0; i < scene.truth.size(); ++i)
      if (scene.truth[i] == k + 2) truth.push_back(static_cast<int>(i));
    const auto pick = pickInScene(scene.cloud, scene.cloud.point(truth[truth.size() / 2]), scene.up,
                                  PipelineOptions());
    ASSERT_TRUE(pick) << pick.reason;
    const auto points = pickedPoints(atFullResolution(scene.cloud, *pick));
    int right = 0;
    for (const int i : points) right += scene.truth[i] == k + 2;
    EXPECT_GT(right, 0.98 * points.size()) << scene.objects[k].name;
    EXPECT_GT(right, 0.8 * truth.size()) << scene.objects[k].name;
  }
}

TEST(Pick, aFineImageIsLookedAtCoarselyAndGivenBackPixelByPixel) {
  const auto scene = boxOnTable();
  const auto pick = pickAt(scene, {0, 0, 0.10});
  ASSERT_TRUE(pick) << pick.reason;
  ASSERT_EQ(pick->window.step, 2);
  const auto full = atFullResolution(scene.cloud, *pick);
  EXPECT_EQ(full.window.step, 1);
  const auto coarse = pickedPoints(*pick), fine = pickedPoints(full);
  EXPECT_NEAR(fine.size(), 4.0 * coarse.size(), 0.1 * fine.size());
  Indices both;
  std::set_intersection(fine.begin(), fine.end(), coarse.begin(), coarse.end(),
                        std::back_inserter(both));
  EXPECT_GT(both.size(), 0.95 * coarse.size());
  for (std::size_t i = 0; i < full.window.cloud.size(); ++i)
    EXPECT_EQ(full.window.cloud.valid(i), scene.cloud.valid(full.window.sourceOf(i)));
}

TEST(Pick, theFrameLiesBehindTheTopWithXAlongItsLongerSide) {
  const auto scene = boxOnTable();
  const auto pick = pickAt(scene, {0, 0, 0.10});
  ASSERT_TRUE(pick) << pick.reason;
  const Eigen::Isometry3d T_table_pick =
      scene.T_camera_table.inverse() * pick->surface.T_camera_pick;
  const Eigen::Vector3d along(std::cos(0.3), std::sin(0.3), 0);
  EXPECT_GT(cosine(T_table_pick.linear().col(2), Eigen::Vector3d::UnitZ()), 0.999);
  EXPECT_GT(cosine(T_table_pick.linear().col(0), along), 0.999);
  EXPECT_NEAR(T_table_pick.linear().determinant(), 1, 1e-9);
  EXPECT_LT((T_table_pick.translation() - Eigen::Vector3d(0, 0, 0.08)).norm(), 0.005);
  EXPECT_NEAR(pick->surface.extents.x(), 0.12, 0.005);
  EXPECT_NEAR(pick->surface.extents.y(), 0.06, 0.005);
}

TEST(Pick, theGripperComesFromAboveAndOpensAlongTheShorterSide) {
  const auto scene = boxOnTable();
  const auto pick = pickAt(scene, {0, 0, 0.10});
  ASSERT_TRUE(pick) << pick.reason;
  const PipelineOptions options;
  const Eigen::Isometry3d T_table_gripper =
      scene.T_camera_table.inverse() * pick->pregrasp.T_camera_gripper;
  EXPECT_LT(cosine(T_table_gripper.linear().col(2), Eigen::Vector3d::UnitZ()), -0.999);
  const Eigen::Vector3d across(-std::sin(0.3), std::cos(0.3), 0);
  EXPECT_GT(std::abs(cosine(T_table_gripper.linear().col(1), across)), 0.99);
  EXPECT_NEAR(T_table_gripper.translation().z(), 0.10 + options.grasp.approach, 0.005);
  EXPECT_NEAR(pick->pregrasp.width, 0.06 + options.grasp.margin, 0.01);
}

TEST(Pick, aCanThatLiesIsGraspedAcrossItsAxis) {
  Mesh can = scene::cylinder(0.035, 0.14);
  can = scene::moved(can,
                     Eigen::Translation3d(-0.07, 0, 0.035) *
                         Eigen::Isometry3d(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitY())));
  const auto scene = scene::render({{"can", can, scene::standing(0, 0, 0.7)}});
  const auto pick = pickAt(scene, {0, 0, 0.07});
  ASSERT_TRUE(pick) << pick.reason;
  const Eigen::Matrix3d axes =
      (scene.T_camera_table.inverse() * pick->surface.T_camera_pick).linear();
  const Eigen::Vector3d along(std::cos(0.7), std::sin(0.7), 0);
  EXPECT_GT(std::abs(cosine(axes.col(0), along)), 0.999);
  EXPECT_LT(std::abs(cosine(axes.col(2), along)), 0.03);
  EXPECT_GT(axes(2, 2), 0.3);
}

TEST(Pick, theLargerOfTwoFacesIsTheMainSurface) {
  for (const double yaw : {0.2, 0.6, 1.2}) {
    const auto scene =
        scene::render({{"box", scene::box(0.05, 0.14, 0.16), scene::standing(0, 0, yaw)}});
    const auto pick = pickAt(scene, {0, 0, 0.16});
    ASSERT_TRUE(pick) << pick.reason;
    const Eigen::Matrix3d axes =
        (scene.T_camera_table.inverse() * pick->surface.T_camera_pick).linear();
    const Eigen::Vector3d out(-std::cos(yaw), -std::sin(yaw), 0);  // of the face to the camera
    EXPECT_GT(cosine(axes.col(2), out), 0.999) << yaw;
  }
}

TEST(Pick, theOriginOfAFlatThingStaysAboveTheTable) {
  const auto scene =
      scene::render({{"tile", scene::box(0.12, 0.12, 0.02), scene::standing(0, 0, 0)}});
  const auto pick = pickAt(scene, {0, 0, 0.02});
  ASSERT_TRUE(pick) << pick.reason;
  const Eigen::Vector3d origin =
      scene.T_camera_table.inverse() * pick->surface.T_camera_pick.translation();
  EXPECT_NEAR(origin.z(), 0.01, 0.002);
}

TEST(Pick, whatIsNoThingHasAReason) {
  const auto scene = boxOnTable();
  const auto in_air = pickAt(scene, {0, 0, 0.3});
  ASSERT_FALSE(in_air);
  EXPECT_TRUE(contains(in_air.reason, "in the air")) << in_air.reason;
  const auto on_table = pickAt(scene, {0, 0.25, 0});
  ASSERT_FALSE(on_table);
  EXPECT_TRUE(contains(on_table.reason, "on the table")) << on_table.reason;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto nowhere = pickInScene(scene.cloud, {nan, 0, 1}, scene.up, PipelineOptions());
  ASSERT_FALSE(nowhere);
  EXPECT_TRUE(contains(nowhere.reason, "not finite")) << nowhere.reason;
}

TEST(Pick, theBottomOfATrayBelongsToItTheTableInAnAngleToNothing) {
  const Mesh left = scene::moved(scene::box(0.01, 0.16, 0.05), 0.075, 0, 0),
             right = scene::moved(scene::box(0.01, 0.16, 0.05), -0.075, 0, 0),
             back = scene::moved(scene::box(0.16, 0.01, 0.05), 0, 0.075, 0),
             front = scene::moved(scene::box(0.16, 0.01, 0.05), 0, -0.075, 0);
  const auto tray = scene::render(
      {{"tray", scene::merged({left, right, back, front}), scene::standing(0, 0, 0.3)}});
  const auto inside = pickAt(tray, {0.02, 0, 0.002});
  ASSERT_TRUE(inside) << inside.reason;
  EXPECT_NEAR(inside->box.size.x(), 0.16, 0.01);
  const auto angle =
      scene::render({{"angle", scene::merged({left, back}), scene::standing(0, 0, 0.3)}});
  const auto beside = pickAt(angle, {0.02, 0.01, 0.002});
  ASSERT_FALSE(beside);
  EXPECT_TRUE(contains(beside.reason, "on the table")) << beside.reason;
}

/// A plane of z = 0.3 under the camera's y axis and a patch over it, and about the patch, as the
/// camera sees it, an arc of `turn` [rad] that is nearer: what a mug that lies shows of its rim.
Found<int> clusterAtBottomOfMug(double turn, float patch_height) {
  Table table;
  table.plane = {0, -1, 0, 0.3};
  table.T_camera_table.linear() << 0, -1, 0, 0, 0, -1, 1, 0, 0;  // x forward, y left, z up
  table.T_camera_table.translation() = Eigen::Vector3d(0, 0.3, 0.8);
  table.hull = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
  const Eigen::Vector3f middle(0, 0.3f - patch_height, 0.9f);
  std::vector<Eigen::Vector3f> points = {middle};
  Indices rim;
  for (int i = 0; i < 100; ++i) {
    const double angle = turn * i / 100;
    rim.push_back(static_cast<int>(points.size()));
    points.push_back(
        0.9f * (middle + Eigen::Vector3f(0.03f * std::cos(angle), 0.03f * std::sin(angle), 0)));
  }
  return clusterAt(clouds::cloudOf(points), {rim}, middle, {table}, TableOptions(), PickOptions());
}

TEST(ClusterAt, aPatchTooSmallForAThingBelongsToWhatTheCameraSeesAllAroundIt) {
  const auto inside = clusterAtBottomOfMug(2 * M_PI, 0.04f);
  ASSERT_TRUE(inside) << inside.reason;
  EXPECT_EQ(*inside, 0);
  const auto open = clusterAtBottomOfMug(1.5 * M_PI, 0.04f);
  ASSERT_FALSE(open);
  EXPECT_TRUE(contains(open.reason, "too small for a thing")) << open.reason;
  const auto through_a_handle = clusterAtBottomOfMug(2 * M_PI, 0);
  ASSERT_FALSE(through_a_handle);
  EXPECT_TRUE(contains(through_a_handle.reason, "on the table")) << through_a_handle.reason;
}

TEST(Pick, aWallBehindTheTableIsNoThing) {
  const Mesh wall = scene::box(0.02, 1.6, 0.8);
  const auto scene = scene::render({{"box", scene::box(0.12, 0.06, 0.10), scene::standing(0, 0, 0)},
                                    {"wall", wall, scene::standing(0.7, 0, 0)}});
  const auto pick = pickAt(scene, {0.69, 0, 0.2});
  ASSERT_FALSE(pick);
  EXPECT_TRUE(contains(pick.reason, "on nothing that stands on a table")) << pick.reason;
}

TEST(Pick, anUnorganisedCloudIsPickedByPoint) {
  const auto scene = boxOnTable();
  const Cloud cloud = clouds::unorganised(selectPoints(scene.cloud, validIndices(scene.cloud)));
  const auto pick = pickInScene(cloud, inCamera(scene, {0, 0, 0.10}), scene.up, PipelineOptions());
  ASSERT_TRUE(pick) << pick.reason;
  EXPECT_GT(pickedPoints(*pick).size(), 1000u);
  const auto at_pixel = pointAtPixel(cloud, {320, 240}, 11);
  ASSERT_FALSE(at_pixel);
  EXPECT_TRUE(contains(at_pixel.reason, "unorganised")) << at_pixel.reason;
}

TEST(WindowAround, aWallOfOnePixelIsNotSteppedOver) {
  Cloud cloud(9, 6, false);
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i)
    cloud.setPoint(i, {0.01f * (i % 9), 0.01f * (i / 9), i % 9 == 3 ? 0.8f : 1.0f});
  cloud.drop(4);  // nor is a pixel without a point taken where there is a point beside it
  const auto window = windowAround(cloud, {0.04f, 0, 1}, 1, 2);
  ASSERT_EQ(window.cloud.width, 5);
  ASSERT_EQ(window.cloud.height, 3);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 5; ++column) {
      const Eigen::Vector3f p = window.cloud.point(row * 5 + column);
      EXPECT_EQ(p.z(), column == 1 ? 0.8f : 1.0f) << row << " " << column;
    }
}

TEST(PointAtPixel, takesTheNearestDepthOrSaysWhyThereIsNone) {
  Cloud cloud(40, 30, false);
  cloud.setPoint(10 * 40 + 14, {0.1f, 0.2f, 1.0f});
  const auto at = [&](double u, double v) { return pointAtPixel(cloud, {u, v}, 9); };
  ASSERT_TRUE(at(14, 10));
  ASSERT_TRUE(at(10, 10));
  EXPECT_EQ(*at(10, 10), Eigen::Vector3f(0.1f, 0.2f, 1.0f));
  EXPECT_TRUE(contains(at(9, 10).reason, "no depth within 9 x 9"));
  EXPECT_TRUE(contains(at(40, 10).reason, "outside the image of 40 x 30"));
  EXPECT_TRUE(contains(at(std::nan(""), 10).reason, "outside the image"));
}

TEST(PointAtPixel, aCamerasPixelFindsTheFrontmostPointOfAnyCloud) {
  const Projection camera{100, 100, 50, 40, 100, 80, 1};
  const Cloud cloud = clouds::cloudOf({{0, 0, 2}, {0, 0, 1}, {0.1f, 0, 1}});
  const auto point = pointAtPixel(cloud, camera, {50, 40}, 5);
  ASSERT_TRUE(point);
  EXPECT_EQ(*point, Eigen::Vector3f(0, 0, 1));
  EXPECT_TRUE(contains(pointAtPixel(cloud, camera, {20, 40}, 5).reason, "no depth"));
}

}  // namespace
}  // namespace tabletop_perception
