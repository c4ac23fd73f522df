#include "tabletop_perception/rests.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "scene.h"

namespace tabletop_perception {
namespace {

/// Turned and moved into an arbitrary place, as scanned meshes are.
Mesh askew(const Mesh& mesh) {
  return scene::moved(mesh, Eigen::Translation3d(0.1, -0.2, 0.3) *
                                Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, -2, 0.5).normalized()));
}

double lowestOf(const Mesh& mesh, const Eigen::Isometry3d& T_table_object) {
  double lowest = 1e9;
  for (const auto& v : mesh.vertices)
    lowest = std::min(lowest, (T_table_object * v.cast<double>()).z());
  return lowest;
}

double highestOf(const Mesh& mesh, const Eigen::Isometry3d& T_table_object) {
  double highest = -1e9;
  for (const auto& v : mesh.vertices)
    highest = std::max(highest, (T_table_object * v.cast<double>()).z());
  return highest;
}

TEST(StableRests, OfABoxAreItsSixFaces) {
  const Mesh mesh = askew(scene::box(0.05, 0.1, 0.2));
  const auto rests = stableRests(mesh.vertices);
  ASSERT_EQ(rests.size(), 6u);
  std::vector<double> heights;
  double sum = 0;
  for (const auto& rest : rests) {
    EXPECT_NEAR(lowestOf(mesh, rest.T_table_object), 0, 1e-6);
    heights.push_back(highestOf(mesh, rest.T_table_object));
    sum += rest.probability;
  }
  EXPECT_NEAR(sum, 1, 1e-9);
  // The larger the face, the more often it is below.
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_NEAR(heights[i], i < 2 ? 0.05 : i < 4 ? 0.1 : 0.2, 1e-6) << i;
  for (std::size_t i = 0; i < 6; i += 2)
    EXPECT_NEAR(rests[i].probability, rests[i + 1].probability, 1e-6);
}

TEST(StableRests, ACubeLiesOnEachFaceWithTheSameProbability) {
  const auto rests = stableRests(askew(scene::box(0.1, 0.1, 0.1)).vertices);
  ASSERT_EQ(rests.size(), 6u);
  for (const auto& rest : rests) EXPECT_NEAR(rest.probability, 1.0 / 6, 1e-6);
}

TEST(StableRests, AThinPrismThatLeansTooFarNeverStandsOnItsEnd) {
  // A parallelogram whose top hangs beyond its base: upright it falls over.
  const Mesh mesh = scene::moved(scene::prism({{0, 0}, {0.04, 0}, {0.14, 0.1}, {0.10, 0.1}}, 0.06),
                                 Eigen::Isometry3d::Identity());
  for (const auto& rest : stableRests(mesh.vertices)) {
    const Eigen::Vector3d down =
        rest.T_table_object.linear().transpose() * -Eigen::Vector3d::UnitZ();
    EXPECT_LT(std::abs(down.y()), 0.99);
  }
}

TEST(StableRests, OfAMeshHeldBehindManyVerticesAreThoseOfItsHull) {
  // A bracket's inner edge is spanned by its hull, where it can lie.
  const Mesh mesh = askew(scene::bracket());
  const auto rests = stableRests(mesh.vertices);
  EXPECT_GE(rests.size(), 5u);
  for (const auto& rest : rests) EXPECT_NEAR(lowestOf(mesh, rest.T_table_object), 0, 1e-6);
}

TEST(StableRests, FlatThingsAreRefused) {
  EXPECT_THROW(stableRests({}), std::invalid_argument);
  EXPECT_THROW(stableRests({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5f, 0.2f, 0}}),
               std::invalid_argument);
}

}  // namespace
}  // namespace tabletop_perception
