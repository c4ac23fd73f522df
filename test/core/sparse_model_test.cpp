#include "tabletop_perception/sparse_model.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/symmetry.h"
#include "views.h"

using namespace tabletop_perception;

namespace {

ObjectModel blockOf(float x, float y, float z) {
  return views::modelOf("block", scene::box(x, y, z), {});
}

}  // namespace

TEST(SparseModel, ABlockLooksNearlyTheSameInItsHalfTurns) {
  EXPECT_EQ(makeSparse(blockOf(0.05f, 0.09f, 0.13f)).turns.size(), 3u);
}

TEST(SparseModel, AnAlmostSquareBlockAlsoInQuarterTurns) {
  EXPECT_EQ(makeSparse(blockOf(0.051f, 0.08f, 0.052f)).turns.size(), 7u);
}

TEST(SparseModel, DeclaredSymmetryLeavesOneTurnForAllThatLookAlike) {
  ObjectModel block = blockOf(0.051f, 0.08f, 0.052f);
  block.symmetry = declaredSymmetry("box", centroidOf(block.surface.points).cast<double>());
  EXPECT_EQ(makeSparse(block).turns.size(), 1u);
}

TEST(SparseModel, ATurnMovesTheSurfaceOntoItself) {
  const ObjectModel block = blockOf(0.05f, 0.09f, 0.13f);
  const KdTree surface(block.surface.points);
  for (const auto& turn : makeSparse(block).turns)
    for (const auto& p : block.surface.points)
      ASSERT_LT(std::sqrt(surface.nearest(turn.cast<float>() * p).squared_distance), 0.004f);
}

TEST(SparseModel, AnIrregularShapeHasNoTurns) {
  EXPECT_TRUE(makeSparse(views::modelOf("bracket", scene::bracket(), {})).turns.empty());
}

TEST(SparseModel, SeesOneSideFromEachDirectionAndNotTheBack) {
  const ObjectModel block = blockOf(0.05f, 0.09f, 0.13f);
  const SparseModel sparse = makeSparse(block);
  const auto& side = sparse.sideTowards(Eigen::Vector3f::UnitX());
  ASSERT_FALSE(side.visible.empty());
  for (const int i : side.visible)
    EXPECT_GT(sparse.surface.normals[i].dot(side.direction), 0)
        << sparse.surface.points[i].transpose();
}
