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
                        observe(image, nullptr, scene::SceneOptions().projection), nullptr, 0.008,
                        RefineOptions());
  }

  /// The same where the points are of another mesh, and the picture and its outline of this one.
  Eigen::Isometry3d foundByOutline(const Mesh& seen, const Eigen::Isometry3d& truth,
                                   const Eigen::Isometry3d& start, bool with_outline) const {
    const Cloud image = views::imageOf(mesh_, truth);
    const auto observation = observe(image, nullptr, scene::SceneOptions().projection);
    const SeenOutline outline(observation, index_, 0, start);
    return bestFreeTurn(index_, 0, start, views::sampled(views::imageOf(seen, truth)), observation,
                        with_outline ? &outline : nullptr, 0.008, RefineOptions());
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

TEST(FreeTurn, BringsAHandleThatNoClusterHoldsWhereItsOutlineIs) {
  const Thing thing(mug());
  const auto truth = thing.seenFrom({0.2, -1, 0.7});
  const auto angleBetween = [&](const Eigen::Isometry3d& found) {
    return angleOf(Eigen::Matrix3d(truth.linear().transpose() * found.linear()));
  };
  for (const double angle : {1.5, 1.0}) {
    const auto start = truth * turnedBy(angle);
    const Mesh body = scene::cylinder(0.045, 0.1);
    EXPECT_LT(angleBetween(thing.foundByOutline(body, truth, start, true)), 0.1) << angle;
    EXPECT_GT(angleBetween(thing.foundByOutline(body, truth, start, false)), 0.5) << angle;
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
