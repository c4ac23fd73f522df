#include "free_turn.h"

#include <cmath>
#include <optional>
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

double angleBetween(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return angleOf(Eigen::Matrix3d(a.linear().transpose() * b.linear()));
}

/// With a wall at this depth behind it [m].
Cloud beforeWall(Cloud image, float z) {
  const Projection camera = scene::SceneOptions().projection;
  for (int v = 0; v < image.height; ++v)
    for (int u = 0; u < image.width; ++u) {
      const int i = v * image.width + u;
      const auto x = static_cast<float>((u - camera.cx) / camera.fx);
      const auto y = static_cast<float>((v - camera.cy) / camera.fy);
      if (!image.valid(i)) image.setPoint(i, z * Eigen::Vector3f(x, y, 1));
    }
  return image;
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
    return found(image, views::sampled(image), start, scene::SceneOptions().projection);
  }

  /// The same of a picture and of points.
  Eigen::Isometry3d found(const Cloud& image, const Surface& points, const Eigen::Isometry3d& start,
                          const std::optional<Projection>& projection,
                          const Table* table = nullptr) const {
    return bestFreeTurn(index_, 0, start, points, observe(image, table, projection), 0.008,
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
    EXPECT_LT(angleBetween(truth, found), 0.1) << angle;
    EXPECT_LT((truth.translation() - found.translation()).norm(), 0.003) << angle;
  }
}

TEST(FreeTurn, BringsAHandleThatNoClusterHoldsWhereThePictureShowsIt) {
  const Thing thing(mug());
  const auto truth = thing.seenFrom({0.2, -1, 0.7});
  const Cloud image = views::imageOf(mug(), truth);
  const Surface body = views::sampled(views::imageOf(scene::cylinder(0.045, 0.1), truth));
  const auto camera = scene::SceneOptions().projection;
  for (const double angle : {1.5, 1.0}) {
    const auto start = truth * turnedBy(angle);
    EXPECT_LT(angleBetween(truth, thing.found(image, body, start, camera)), 0.1) << angle;
    EXPECT_GT(angleBetween(truth, thing.found(image, body, start, std::nullopt)), 0.5) << angle;
  }
}

TEST(FreeTurn, IsNotHeldByThePointsOfWhatTouchesIt) {
  const Mesh beside = scene::moved(scene::box(0.08, 0.06, 0.1), 0, 0.077, 0);
  const Thing thing(mug());
  const auto truth = thing.seenFrom({1, -0.2, 0.7});
  const Cloud image = views::imageOf(scene::merged({mug(), beside}), truth);
  const auto start = truth * turnedBy(M_PI / 2);  // the handle in the box
  const auto found = thing.found(beforeWall(image, 1.5f), views::sampled(image), start,
                                 scene::SceneOptions().projection);
  EXPECT_LT(angleBetween(truth, found), 0.1);
}

TEST(FreeTurn, HidesAHandleThatIsNotSeen) {
  const Thing thing(mug());
  const auto truth = thing.seenFrom({-1, 0, 0.3});
  const Cloud image = views::imageOf(mug(), truth);
  const auto foundFrom = [&](const Eigen::Isometry3d& start) {
    return thing.found(beforeWall(image, 1.5f), views::sampled(image), start,
                       scene::SceneOptions().projection);
  };
  const auto hidden = truth * turnedBy(0.2), in_view = truth * turnedBy(2);
  EXPECT_TRUE(foundFrom(hidden).isApprox(hidden)) << "one turn is as good as another";
  EXPECT_LT(angleBetween(truth, foundFrom(in_view)), 0.5);
}

TEST(FreeTurn, HidesNoHandleInTheTable) {
  const Thing thing(mug());
  const auto lying = thing.seenFrom({0.2, 1, 0.3});  // on the side that is -y
  Table table;
  table.plane.head<3>() = lying.linear().col(1);
  table.plane[3] = -table.plane.head<3>().dot(lying * Eigen::Vector3d(0, -0.045, 0));
  const Mesh body = scene::cylinder(0.045, 0.1);
  const Mesh board = scene::moved(scene::box(0.6, 0.02, 0.6), 0, -0.055, -0.3);
  const Cloud image = views::imageOf(scene::merged({body, board}), lying);
  const auto downAt = [&](const Table* known) -> double {
    const auto found = thing.found(image, views::sampled(views::imageOf(body, lying)), lying,
                                   scene::SceneOptions().projection, known);
    return -table.plane.head<3>().dot(found.linear().col(0));  // of the handle
  };
  EXPECT_GT(downAt(nullptr), 0.72) << "where nobody knows of a table";
  EXPECT_LT(downAt(&table), 0.68);
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
