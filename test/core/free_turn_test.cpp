#include "free_turn.h"

#include <utility>

#include <gtest/gtest.h>

#include "tabletop_perception/symmetry.h"
#include "views.h"

using namespace tabletop_perception;

namespace {

Mesh mug() {
  return scene::merged(
      {scene::cylinder(0.045, 0.1), scene::moved(scene::box(0.03, 0.015, 0.06), 0.057, 0, 0.02)});
}

Eigen::Isometry3d turnedBy(double angle) {
  return Eigen::Isometry3d(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
}

/// A thing that is looked at, and where it is said to be from a start that is turned.
class Thing {
 public:
  explicit Thing(Mesh mesh) : mesh_(std::move(mesh)) {
    ObjectModel model = views::modelOf("thing", mesh_, {});
    model.symmetry = detectSymmetry(model.surface);
    index_ = ModelIndex({model});
  }

  Eigen::Isometry3d seenFrom(const Eigen::Vector3d& direction) const {
    return views::lookAt(mesh_, direction, 0.8);
  }

  Eigen::Isometry3d found(const Eigen::Isometry3d& truth, const Eigen::Isometry3d& start) const {
    const Cloud image = views::imageOf(mesh_, truth);
    return bestFreeTurn(index_, 0, start, views::sampled(image),
                        observe(image, nullptr, scene::SceneOptions().projection), 0.008,
                        RefineOptions());
  }

 private:
  Mesh mesh_;
  ModelIndex index_;
};

}  // namespace

TEST(FreeTurn, BringsTheHandleOfAMugWhereItIsSeen) {
  const Thing thing(mug());
  const auto truth = thing.seenFrom({1, 0.8, 0.7});
  for (const double angle : {0.7, 2.0, -2.5}) {
    const auto found = thing.found(truth, truth * turnedBy(angle));
    const Eigen::Matrix3d between = truth.linear().transpose() * found.linear();
    EXPECT_LT(angleOf(between), 0.1) << angle;
    EXPECT_LT((truth.translation() - found.translation()).norm(), 0.003) << angle;
  }
}

TEST(FreeTurn, StaysWhereTheHandleIsHidden) {
  const Thing thing(mug());
  const auto truth = thing.seenFrom({-1, 0, 0.3});
  const auto start = truth * turnedBy(0.2);
  EXPECT_TRUE(thing.found(truth, start).isApprox(start));
}

TEST(FreeTurn, StaysWithThingsThatLeaveNoTurnFree) {
  const Thing block(scene::house());
  const auto truth = block.seenFrom({1, 0.8, 0.7});
  const auto start = truth * turnedBy(0.02);
  EXPECT_TRUE(block.found(truth, start).isApprox(start));
}

TEST(FreeTurn, StaysWithACanOfWhichEveryTurnIsAsGood) {
  const Thing can(scene::cylinder(0.045, 0.1));
  const auto truth = can.seenFrom({1, 0.8, 0.7});
  const auto start = truth * turnedBy(1);
  EXPECT_TRUE(can.found(truth, start).isApprox(start));
}
