#include "tabletop_perception/revolution.h"

#include <gtest/gtest.h>

#include "views.h"

using namespace tabletop_perception;

namespace {

Surface surfaceOf(const Mesh& mesh) { return views::modelOf("thing", mesh, {}).surface; }

/// A can with a handle at its side.
Mesh mug() {
  return scene::merged(
      {scene::cylinder(0.045, 0.1), scene::moved(scene::box(0.03, 0.015, 0.06), 0.057, 0, 0.02)});
}

}  // namespace

TEST(Revolution, ItsAxisIsFoundWhateverSticksOut) {
  const auto axis = axisOfMost(surfaceOf(mug()));
  ASSERT_TRUE(axis);
  EXPECT_GT(std::abs(axis->direction.z()), 0.999);
  const Eigen::Vector3d off = axis->direction.cross(axis->point);  // from the origin to the line
  EXPECT_LT(off.norm(), 0.003);
}

TEST(Revolution, ACanHasAnAxisToo) {
  EXPECT_TRUE(axisOfMost(surfaceOf(scene::cylinder(0.03, 0.1))));
}

TEST(Revolution, ABlockHasNone) {
  EXPECT_FALSE(axisOfMost(surfaceOf(scene::box(0.05, 0.05, 0.1))));
  EXPECT_FALSE(axisOfMost(surfaceOf(scene::house())));
}

TEST(Revolution, NothingHasNone) { EXPECT_FALSE(axisOfMost(Surface())); }
