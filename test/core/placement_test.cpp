#include "tabletop_perception/placement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "scene.h"

namespace tabletop_perception {
namespace {

TableObjects someObjects() {
  TableObjects objects;
  objects.push_back(std::make_unique<TableObject>("box", scene::box(0.1, 0.06, 0.15)));
  objects.push_back(std::make_unique<TableObject>("can", scene::cylinder(0.035, 0.11)));
  objects.push_back(std::make_unique<TableObject>("bracket", scene::bracket()));
  objects.push_back(std::make_unique<TableObject>("house", scene::house()));
  return objects;
}

TEST(Clearance, OfBoxesIsTheDistanceOfTheirFaces) {
  const TableObject a("a", scene::box(0.1, 0.1, 0.1)), b("b", scene::box(0.2, 0.04, 0.3));
  const auto T_a = scene::standing(0, 0, 0);
  EXPECT_NEAR(clearance(a, T_a, b, scene::standing(0, 0.09, 0), 1), 0.02, 1e-6);
  EXPECT_NEAR(clearance(a, T_a, b, scene::standing(0.18, 0, 0), 1), 0.03, 1e-6);
  EXPECT_NEAR(clearance(b, scene::standing(0.18, 0, 0), a, T_a, 1), 0.03, 1e-6);
  EXPECT_NEAR(clearance(a, T_a, b, scene::standing(2, 0, 0), 0.5), 0.5, 1e-6);  // the limit
}

/// The least distance of each placed object but the first to those before it.
std::vector<double> gapsOf(const TableObjects& objects, const std::vector<Placement>& placed) {
  std::vector<double> gaps;
  for (std::size_t i = 1; i < placed.size(); ++i) {
    gaps.push_back(1);
    for (std::size_t j = 0; j < i; ++j)
      gaps.back() = clearance(*objects[placed[i].object], placed[i].T_table_object,
                              *objects[placed[j].object], placed[j].T_table_object, gaps.back());
  }
  return gaps;
}

class PlacedWithGap : public testing::TestWithParam<double> {};

TEST_P(PlacedWithGap, EachObjectIsTheGapFromTheNearest) {
  const auto objects = someObjects();
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    Random random(seed);
    const auto placed = placeObjects(objects, {0, 1, 2, 3}, GetParam(), 0.5, random);
    ASSERT_EQ(placed.size(), 4u);
    for (const double gap : gapsOf(objects, placed)) {
      EXPECT_GT(gap, GetParam() - 1e-6);  // through another it would be nearer
      EXPECT_LT(gap, GetParam() + 1e-3);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Gaps, PlacedWithGap, testing::Values(0, 0.005, 0.04));

TEST(PlaceObjects, EachRestsOnTheTableWithinTheRadius) {
  const auto objects = someObjects();
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    Random random(seed);
    for (const auto& placement : placeObjects(objects, {3, 2, 1, 0}, 0, 0.3, random)) {
      double lowest = 1;
      for (const auto& point : objects[placement.object]->points) {
        const Eigen::Vector3d p = placement.T_table_object * point.cast<double>();
        lowest = std::min(lowest, p.z());
        EXPECT_LE(p.head<2>().norm(), 0.3 + 1e-6);
      }
      EXPECT_NEAR(lowest, 0, 1e-5);
    }
  }
}

/// Whether a point is inside a box of the given sides that stands on z = 0.
bool inBox(const Eigen::Vector3d& p, const Eigen::Vector3d& sides, double margin) {
  return std::abs(p.x()) < sides.x() / 2 - margin && std::abs(p.y()) < sides.y() / 2 - margin &&
         p.z() > margin && p.z() < sides.z() - margin;
}

TEST(PlaceObjects, TouchingBoxesDoNotReachIntoEachOther) {
  const Eigen::Vector3d sides(0.12, 0.07, 0.05);
  TableObjects objects;
  objects.push_back(
      std::make_unique<TableObject>("a", scene::box(sides.x(), sides.y(), sides.z())));
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const auto placed = placeObjects(objects, {0, 0, 0}, 0, 0.4, random);
    ASSERT_EQ(placed.size(), 3u);
    for (const auto& one : placed)
      for (const auto& other : placed) {
        if (&one == &other) continue;
        const Eigen::Isometry3d T_other_one = other.T_table_object.inverse() * one.T_table_object;
        for (const auto& point : objects[0]->points)
          ASSERT_FALSE(inBox(T_other_one * point.cast<double>(), sides, 1e-3)) << seed;
      }
  }
}

TEST(PlaceObjects, StopsWhereNoMoreFit) {
  const auto objects = someObjects();
  Random random(1);
  const auto placed = placeObjects(objects, std::vector<std::size_t>(50, 0), 0.02, 0.25, random);
  EXPECT_GE(placed.size(), 3u);
  EXPECT_LT(placed.size(), 50u);
}

}  // namespace
}  // namespace tabletop_perception
