#include "tabletop_perception/simulate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "scene.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {
namespace {

class Simulated : public testing::Test {
 protected:
  Simulated() {
    meshes_ = {{"bracket", scene::painted(scene::bracket(), 0xC03030)},
               {"can", scene::cylinder(0.04, 0.1)},
               {"house", scene::house()}};
    for (const auto& [name, mesh] : meshes_)
      objects_.push_back(std::make_unique<TableObject>(name, mesh));
    options_.objects = 3;
  }

  SimulatedScene scene(std::uint64_t seed) const {
    Random random(seed);
    return simulateScene(objects_, options_, random);
  }

  std::map<std::string, Mesh> meshes_;
  TableObjects objects_;
  SimulationOptions options_;
};

TEST_F(Simulated, SameSeedGivesTheSameScene) {
  const auto a = scene(5), b = scene(5), other = scene(6);
  EXPECT_EQ(a.labels, b.labels);
  EXPECT_EQ(a.cloud.rgb, b.cloud.rgb);
  for (std::size_t i = 0; i < a.cloud.size(); ++i) {
    ASSERT_EQ(a.cloud.valid(i), b.cloud.valid(i));
    if (!a.cloud.valid(i)) continue;
    ASSERT_EQ(a.cloud.z[i], b.cloud.z[i]);
  }
  EXPECT_NE(a.labels, other.labels);
}

TEST_F(Simulated, ObjectsStandOnTheTableThatIsStated) {
  const auto made = scene(1);
  ASSERT_EQ(made.objects.size(), 3u);
  EXPECT_TRUE(made.plane.head<3>().isApprox(made.up, 1e-9));
  for (const auto& object : made.objects) {
    double lowest = 1;
    for (const auto& v : meshes_.at(object.name).vertices)
      lowest = std::min(lowest, made.up.dot(object.T_camera_object * v.cast<double>()));
    EXPECT_NEAR(lowest + made.plane[3], 0, 1e-3) << object.name;
  }
}

TEST_F(Simulated, VisibleShareIsThatOfTheLabels) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const auto made = scene(seed);
    for (const auto& object : made.objects) {
      const auto pixels = std::count(made.labels.begin(), made.labels.end(), object.label);
      const auto alone = validIndices(MeshRenderer(meshes_.at(object.name))
                                          .render(object.T_camera_object, options_.projection))
                             .size();
      EXPECT_EQ(object.visible_pixels, static_cast<std::size_t>(pixels));
      EXPECT_DOUBLE_EQ(object.visible, static_cast<double>(pixels) / alone);
      EXPECT_GT(object.visible, 0);
      EXPECT_LE(object.visible, 1);
    }
  }
}

TEST_F(Simulated, LabelsNameWhatTheDepthShows) {
  const auto made = scene(2);
  int on_table = 0, off_table = 0;
  for (const int i : validIndices(made.cloud)) {
    if (made.labels[i] != SimulatedScene::TABLE) continue;
    const double height =
        made.plane.head<3>().dot(made.cloud.point(i).cast<double>()) + made.plane[3];
    (std::abs(height) < 0.02 ? on_table : off_table) += 1;
  }
  EXPECT_GT(on_table, 50000);
  EXPECT_LT(off_table, 0.02 * on_table);  // the slab's sides, and outlines
}

TEST_F(Simulated, PaintedObjectsKeepTheirHue) {
  const auto made = scene(3);
  const auto bracket =
      std::find_if(made.objects.begin(), made.objects.end(),
                   [](const SimulatedObject& object) { return object.name == "bracket"; });
  ASSERT_NE(bracket, made.objects.end());
  for (std::size_t i = 0; i < made.labels.size(); ++i) {
    if (made.labels[i] != bracket->label) continue;
    const int red = made.cloud.rgb[i] >> 16 & 0xFF, green = made.cloud.rgb[i] >> 8 & 0xFF;
    ASSERT_GT(red, 2 * green);
  }
}

TEST_F(Simulated, ThePipelineFindsTableAndObjects) {
  options_.gap = 0.08;
  options_.min_pitch_deg = 45;
  const auto made = scene(4);
  const auto found = segmentScene(made.cloud, made.up, PipelineOptions());
  ASSERT_TRUE(found.table);
  EXPECT_GT(found.table->plane.head<3>().dot(made.up), std::cos(M_PI / 180));
  EXPECT_EQ(found.clusters.size(), 3u);
}

TEST_F(Simulated, TooManyObjectsAreRefusedWithTheNumberThatFits) {
  options_.objects = 60;
  try {
    scene(1);
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    const std::string what = error.what();
    EXPECT_EQ(what.rfind("only ", 0), 0u) << what;
    EXPECT_NE(what.find(" of 60 objects fit"), std::string::npos) << what;
  }
}

TEST_F(Simulated, EachObjectComesOnceBeforeAnyComesAgain) {
  std::set<std::string> names;
  for (const auto& object : scene(7).objects) names.insert(object.name);
  EXPECT_EQ(names.size(), 3u);
}

/// All frames of a sequence by their number.
std::vector<SimulatedScene> framesOf(const std::function<void(const FrameVisitor&)>& simulate) {
  std::vector<SimulatedScene> frames;
  simulate([&](int frame, SimulatedScene scene) {
    EXPECT_EQ(static_cast<std::size_t>(frame), frames.size());
    frames.push_back(std::move(scene));
  });
  return frames;
}

TEST_F(Simulated, InAStillSequenceOnlyTheNoiseChanges) {
  const auto frames = framesOf([&](const FrameVisitor& visit) {
    Random random(4);
    simulateStill(objects_, options_, 2, random, visit);
  });
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].labels, frames[1].labels);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_EQ(frames[0].objects[k].T_camera_object.matrix(),
              frames[1].objects[k].T_camera_object.matrix());
  int same = 0, valid = 0;
  for (std::size_t i = 0; i < frames[0].cloud.size(); ++i) {
    if (!frames[0].cloud.valid(i) || !frames[1].cloud.valid(i)) continue;
    ++valid;
    same += frames[0].cloud.z[i] == frames[1].cloud.z[i];
  }
  EXPECT_LT(same, valid / 2);  // not all: depths come in steps
}

class SimulatedSequence : public Simulated {
 protected:
  /// Frame k of 21 shows what is at 5 k percent of it.
  const std::vector<SimulatedScene>& frames() {
    static const auto frames = framesOf([&](const FrameVisitor& visit) {
      Random random(4);
      simulateSequence(objects_, options_, 21, random, visit);
    });
    return frames;
  }

  static std::vector<bool> movingIn(const SimulatedScene& frame) {
    std::vector<bool> moving;
    for (const auto& object : frame.objects) moving.push_back(object.moving);
    return moving;
  }
};

TEST_F(SimulatedSequence, ThingsArePutDownMovedAndTakenAway) {
  ASSERT_EQ(frames().size(), 21u);
  EXPECT_EQ(movingIn(frames()[0]), (std::vector<bool>{false, false}));
  EXPECT_EQ(movingIn(frames()[4]), (std::vector<bool>{false, false, true}));
  EXPECT_EQ(movingIn(frames()[7]), (std::vector<bool>{false, false, false}));
  EXPECT_EQ(movingIn(frames()[9]), (std::vector<bool>{true, false, false}));
  EXPECT_EQ(movingIn(frames()[12]), (std::vector<bool>{false, false, false}));
  EXPECT_EQ(movingIn(frames()[18]), (std::vector<bool>{false, false, true}));
  EXPECT_EQ(movingIn(frames()[20]), (std::vector<bool>{false, false}));
  const auto placeOf = [&](int frame, int object) {
    return Eigen::Vector3d(frames()[frame].objects[object].T_camera_object.translation());
  };
  EXPECT_GT((placeOf(12, 0) - placeOf(0, 0)).norm(), 0.05);
  EXPECT_LT((placeOf(12, 1) - placeOf(0, 1)).norm(), 1e-9);
}

TEST_F(SimulatedSequence, WhatIsNotMovingStandsOnTheTable) {
  for (const auto& frame : frames())
    for (const auto& object : frame.objects) {
      double lowest = 1;
      for (const auto& v : meshes_.at(object.name).vertices)
        lowest = std::min(lowest, frame.up.dot(object.T_camera_object * v.cast<double>()));
      if (object.moving)
        EXPECT_GT(lowest + frame.plane[3], -1e-3) << object.name;
      else
        EXPECT_NEAR(lowest + frame.plane[3], 0, 1e-3) << object.name;
    }
}

TEST_F(SimulatedSequence, AForearmHidesThings) {
  const auto tableOf = [&](int frame) {
    const auto& labels = frames()[frame].labels;
    return std::count(labels.begin(), labels.end(), SimulatedScene::TABLE);
  };
  EXPECT_LT(tableOf(14), 0.97 * tableOf(12));
  EXPECT_EQ(tableOf(11), tableOf(12));
}

}  // namespace
}  // namespace tabletop_perception
