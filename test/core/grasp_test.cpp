#include "tabletop_perception/grasp.h"

#include <gtest/gtest.h>

namespace tabletop_perception {
namespace {

/// The plane z = 0, seen from above.
Table tableAtZero() {
  Table table;
  table.plane = {0, 0, 1, 0};
  return table;
}

/// A gripper that closes at a point and comes along `approach`, opening across it along y.
StoredGrasp graspAt(const std::string& name, const Eigen::Vector3d& p,
                    const Eigen::Vector3d& approach, double preference = 0) {
  StoredGrasp grasp;
  grasp.name = name;
  grasp.preference = preference;
  grasp.width = 0.06;
  const Eigen::Vector3d z = approach.normalized(), y = Eigen::Vector3d::UnitY();
  grasp.T_object_gripper.linear() << y.cross(z), y, z;
  grasp.T_object_gripper.translation() = p;
  return grasp;
}

const Eigen::Vector3d DOWN(0, 0, -1), FORWARD(1, 0, 0), UP(0, 0, 1);

std::string reasonFor(const StoredGrasp& grasp, const GraspOptions& options = {},
                      const Eigen::Isometry3d& T_camera_object = Eigen::Isometry3d::Identity()) {
  return placedGrasps({grasp}, T_camera_object, tableAtZero(), options).at(0).reason;
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(PlacedGrasps, comeInTheOrderOfPreferenceThenOfNames) {
  const auto placed =
      placedGrasps({graspAt("b", {0, 0, 0.1}, DOWN, 1), graspAt("a", {0, 0, 0.1}, DOWN, 1),
                    graspAt("best", {0, 0, 0.1}, DOWN, 5)},
                   Eigen::Isometry3d::Identity(), tableAtZero(), GraspOptions());
  ASSERT_EQ(placed.size(), 3u);
  EXPECT_EQ(placed[0].grasp.name, "best");
  EXPECT_EQ(placed[1].grasp.name, "a");
  EXPECT_EQ(placed[2].grasp.name, "b");
}

TEST(PlacedGrasps, moveWithTheObjectAndWaitBeforeIt) {
  const Eigen::Isometry3d T_camera_object =
      Eigen::Translation3d(1, 2, 0.3) *
      Eigen::Isometry3d(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()));
  const auto placed = placedGrasps({graspAt("side", {0.1, 0, 0.1}, FORWARD)}, T_camera_object,
                                   tableAtZero(), GraspOptions());
  EXPECT_TRUE(placed[0].T_camera_gripper.translation().isApprox(Eigen::Vector3d(1, 2.1, 0.4)));
  EXPECT_TRUE(placed[0].T_camera_pregrasp.translation().isApprox(Eigen::Vector3d(1, 2.0, 0.4)));
  EXPECT_EQ(placed[0].reason, "");
}

TEST(PlacedGrasps, theFingertipsStayAboveTheTable) {
  EXPECT_EQ(reasonFor(graspAt("top", {0, 0, 0.003}, DOWN)), "");
  const auto low = reasonFor(graspAt("low", {0, 0, 0.001}, DOWN));
  EXPECT_TRUE(contains(low, "a finger would be 0.001 m above the table, clearance 0.002")) << low;
  const auto through = reasonFor(graspAt("through", {0, 0, -0.01}, DOWN));
  EXPECT_TRUE(contains(through, "a finger would be 0.010 m below the table")) << through;
}

TEST(PlacedGrasps, thePalmOfAGripperFromTheSideStaysAboveTheTable) {
  GraspOptions options;
  options.palm_breadth = 0.08;
  EXPECT_EQ(reasonFor(graspAt("high", {0, 0, 0.045}, FORWARD), options), "");
  const auto low = reasonFor(graspAt("low", {0, 0, 0.035}, FORWARD), options);
  EXPECT_TRUE(contains(low, "the palm would be 0.005 m below the table")) << low;
  options.palm_breadth = 0.02;
  EXPECT_EQ(reasonFor(graspAt("low", {0, 0, 0.035}, FORWARD), options), "");
}

TEST(PlacedGrasps, thereIsNoWayFromBelow) {
  const auto reason = reasonFor(graspAt("up", {0, 0, 0.2}, UP));
  EXPECT_TRUE(contains(reason, "the palm would be 0.050 m below the table at the pregrasp"))
      << reason;
  EXPECT_TRUE(contains(reasonFor(graspAt("up", {0, 0, 0.1}, UP)), "below the table,"));
}

TEST(PlacedGrasps, aGripperThatTiltsIsJudgedByItsLowestCorner) {
  // 45 deg: the fingers' lower edges lie half a breadth times sqrt(1/2) below the fingertips'
  // middle
  const Eigen::Vector3d slanting(1, 0, -1);
  EXPECT_EQ(reasonFor(graspAt("slanting", {0, 0, 0.010}, slanting)), "");
  EXPECT_NE(reasonFor(graspAt("slanting", {0, 0, 0.008}, slanting)), "");
}

TEST(PlacedGrasps, whetherTheyGoDependsOnHowTheObjectLies) {
  const Eigen::Isometry3d lying =
      Eigen::Translation3d(0, 0, 0.03) *
      Eigen::Isometry3d(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
  const auto from_top = graspAt("top", {0, 0, 0.02}, DOWN);
  EXPECT_EQ(reasonFor(from_top), "");
  EXPECT_NE(reasonFor(from_top, {}, lying), "");
}

}  // namespace
}  // namespace tabletop_perception
