#include "tabletop_perception/model.h"

#include <limits>
#include <string>

#include <gtest/gtest.h>

using namespace tabletop_perception;

namespace {

/// Two points that face each other, seen once: the least that is whole.
ObjectModel wholeModel() {
  ObjectModel model;
  model.name = "milk";
  model.surface.points = {{0, 0, 0}, {0, 0, 0.1f}};
  model.surface.normals = {{0, 0, -1}, {0, 0, 1}};
  model.diameter = 0.1;
  model.views.resize(1);
  model.views[0].surface = model.surface;
  model.views[0].descriptors = {{"vfh", {1, 2, 3}, Eigen::Vector3f::Zero(), {}}};
  return model;
}

std::string refusalOf(const ObjectModel& model) {
  try {
    checkModel(model);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "was not refused";
}

constexpr float NAN_VALUE = std::numeric_limits<float>::quiet_NaN();

}  // namespace

TEST(Model, NamesAreWhatATfFrameCanHold) {
  for (const char* good : {"milk", "Milk_2", "a", "003-cracker_box"})
    EXPECT_NO_THROW(checkObjectName(good)) << good;
  EXPECT_NO_THROW(checkObjectName(std::string(100, 'a')));
  for (const char* bad :
       {"", " ", "milk carton", "a/b", "..", "a.b", "a\n", "k\xC3\xA4se", "unknown"})
    EXPECT_THROW(checkObjectName(bad), std::invalid_argument) << bad;
  EXPECT_THROW(checkObjectName(std::string(101, 'a')), std::invalid_argument);
}

TEST(Model, AWholeModelIsAccepted) { EXPECT_EQ(refusalOf(wholeModel()), "was not refused"); }

TEST(Model, WhatIsMissingIsNamed) {
  auto model = wholeModel();
  model.surface = {};
  EXPECT_EQ(refusalOf(model), "object 'milk' has no points");
  model = wholeModel();
  model.views.clear();
  EXPECT_EQ(refusalOf(model), "object 'milk' has no view");
  model = wholeModel();
  model.views[0].surface.normals.pop_back();
  EXPECT_EQ(refusalOf(model), "object 'milk', view 0, has 1 normals for 2 points");
  model = wholeModel();
  model.colors = {1};
  EXPECT_EQ(refusalOf(model), "object 'milk' has 1 colours for 2 points");
  model = wholeModel();
  model.diameter = 0;
  EXPECT_EQ(refusalOf(model), "object 'milk' has the diameter 0.000000, must be positive");
  model = wholeModel();
  model.options.leaf = 7;
  EXPECT_EQ(refusalOf(model), "descriptor.leaf must be between 0.001 and 0.05, got 7");
}

TEST(Model, NumbersThatAreNotFiniteAreRefusedWhereverTheyStand) {
  const auto refused = [](const auto& damage) {
    auto model = wholeModel();
    damage(model);
    return refusalOf(model) != "was not refused";
  };
  EXPECT_TRUE(refused([](ObjectModel& m) { m.surface.points[1].y() = NAN_VALUE; }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.surface.normals[1].y() = NAN_VALUE; }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.surface.normals[1] = {0, 0, 2}; }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.diameter = NAN_VALUE; }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.symmetry.center.x() = NAN_VALUE; }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.symmetry.axis.x() = NAN_VALUE; }));
  EXPECT_TRUE(refused([](ObjectModel& m) {
    m.symmetry.rotations.push_back(Eigen::Matrix3d::Constant(NAN_VALUE));
  }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.views[0].surface.points[0].z() = 1 / 0.0f; }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.views[0].T_view_object(1, 3) = NAN_VALUE; }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.views[0].descriptors[0].values[2] = NAN_VALUE; }));
  EXPECT_TRUE(refused([](ObjectModel& m) { m.views[0].descriptors[0].centroid[2] = NAN_VALUE; }));
}
