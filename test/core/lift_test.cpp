#include "lift.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "views.h"

using namespace tabletop_perception;

namespace {

constexpr double MM = 0.001;

/// The plane z = `height`, as large as a desk.
Table tableAt(double height) {
  Table table;
  table.plane = {0, 0, 1, -height};
  table.T_camera_table.translation().z() = height;
  table.hull = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
  return table;
}

/// A level patch of `side` about (x, 0) at a height, a point every 5 mm.
Surface levelPatch(double x, double height, double side) {
  Surface patch;
  const int half = static_cast<int>(std::lround(side / 2 / 0.005));
  for (int i = -half; i <= half; ++i)
    for (int j = -half; j <= half; ++j) {
      patch.points.push_back(Eigen::Vector3d(x + 0.005 * i, 0.005 * j, height).cast<float>());
      patch.normals.push_back(Eigen::Vector3f::UnitZ());
    }
  return patch;
}

/// Of a box of 10 x 6 x 12 cm whose underside is so high. `explained`: whether it explains what is
/// there itself.
double liftAt(double height, const std::vector<Surface>& parts, bool explained = false,
              const std::vector<Table>& tables = {tableAt(0)}) {
  static const ModelIndex index({views::modelOf("box", scene::box(0.10, 0.06, 0.12), {})});
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().z() = height;
  Marks marks(parts);
  if (explained)
    for (std::size_t k = 0; k < parts.size(); ++k)
      marks.mark(k, std::vector<std::uint32_t>((parts[k].size() + 31) / 32, 0xFFFFFFFF));
  static const Cloud nothing(1, 1, false);
  return liftOf(index, 0, T, parts, marks, Observations(nothing, tables), tables);
}

}  // namespace

TEST(Lift, IsTheHeightOfTheLowestPointAboveTheTable) {
  EXPECT_NEAR(liftAt(0, {}), 0, 0.1 * MM);
  EXPECT_NEAR(liftAt(0.06, {}), 0.06, 0.1 * MM);
  EXPECT_NEAR(liftAt(-0.02, {}), -0.02, 0.1 * MM) << "sunk into it";
}

TEST(Lift, IsNoneWithoutATable) { EXPECT_EQ(liftAt(0.06, {}, false, {}), 0); }

TEST(Lift, IsAboveTheTableThatTheObjectIsOver) {
  Table shelf = tableAt(0.4);
  EXPECT_NEAR(liftAt(0.45, {}, false, {tableAt(0), shelf}), 0.05, 0.1 * MM);
  for (auto& corner : shelf.hull) corner.x() += 2;
  EXPECT_NEAR(liftAt(0.45, {}, false, {tableAt(0), shelf}), 0.45, 0.1 * MM) << "beside the shelf";
}

TEST(Lift, IsNoneWhereSomethingCarriesTheObject) {
  EXPECT_EQ(liftAt(0.06, {levelPatch(0, 0.06, 0.1)}), 0);
  EXPECT_EQ(liftAt(0.06, {levelPatch(0.3, 0.06, 0.1), levelPatch(0, 0.05, 0.1)}), 0)
      << "in any part, and a little deeper, as behind a rim";
}

TEST(Lift, StaysWhereTheCameraSawThroughBelowWhatSeemsToCarryTheObject) {
  // A bar that is held in the air, of whose end the object is a piece, and one that stands there.
  const auto liftSeen = [](double underside) {
    const auto scene = scene::render(
        {{"bar", scene::moved(scene::box(0.10, 0.06, 0.3 - underside), 0, 0, underside),
          scene::standing(0, 0, 0)}},
        {});
    Table table;
    table.plane = scene.plane;
    table.T_camera_table = scene.T_camera_table;
    table.hull = {{-0.5, -0.7}, {0.5, -0.7}, {0.5, 0.7}, {-0.5, 0.7}};
    const std::vector<Table> tables{table};
    const std::vector<Surface> parts{transformed(levelPatch(0, 0.18, 0.1), scene.T_camera_table)};
    static const ModelIndex index({views::modelOf("box", scene::box(0.10, 0.06, 0.12), {})});
    const Eigen::Isometry3d T = scene.T_camera_table * Eigen::Translation3d(0, 0, 0.18);
    const Observations observations(scene.cloud, tables);
    return liftOf(index, 0, T, parts, Marks(parts), observations, tables);
  };
  EXPECT_NEAR(liftSeen(0.16), 0.18, MM);
  EXPECT_EQ(liftSeen(0), 0);
}

TEST(Lift, StaysWhereNothingLiesRightUnderTheObject) {
  const auto expectStays = [](const Surface& patch, const char* where) {
    EXPECT_NEAR(liftAt(0.06, {patch}), 0.06, 0.1 * MM) << where;
  };
  expectStays(levelPatch(0, 0.08, 0.1), "inside the object");
  expectStays(levelPatch(0, 0.01, 0.1), "far below it");
  expectStays(levelPatch(0.13, 0.06, 0.1), "beside it");
  expectStays(levelPatch(0, 0.06, 0.01), "nine stray points");
}

TEST(Lift, DoesNotTakeTheObjectsOwnPointsForACarrier) {
  EXPECT_NEAR(liftAt(0.06, {levelPatch(0, 0.06, 0.1)}, true), 0.06, 0.1 * MM);
}
