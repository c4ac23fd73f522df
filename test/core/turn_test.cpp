#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scene.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/train.h"

using namespace tabletop_perception;

namespace {

/// What is made of a thing that was taught and stands on a table, seen by a camera with noise.
SceneObject recognized(const Mesh& mesh, double yaw) {
  const ModelIndex index({trainFromMesh("thing", mesh, DescriptorOptions(), {})});
  scene::SceneOptions options;
  options.noise = 0.0015;
  const auto scene = scene::render({{"thing", mesh, scene::standing(0, 0, yaw)}}, options);
  PipelineOptions whole;
  whole.split.enabled = false;
  const auto found = recognizeScene(scene.cloud, scene.up, index, whole);
  EXPECT_EQ(found.objects.size(), 1u);
  return found.objects.empty() ? SceneObject() : found.objects.front();
}

/// A square post with a knob on one side, which lies along x.
Mesh post() {
  return scene::merged(
      {scene::box(0.05, 0.05, 0.09), scene::moved(scene::box(0.01, 0.02, 0.02), 0.03, 0, 0.035)});
}

}  // namespace

TEST(Turn, OfABoxWithClearlyDifferentSidesIsSure) {
  const auto box = recognized(scene::box(0.06, 0.10, 0.15), 0.5);
  EXPECT_EQ(box.name, "thing") << box.reason;
  EXPECT_GT(box.evidence.turn, 0.95) << "half turns are its symmetry";
}

TEST(Turn, IsSureWhereTheKnobIsSeen) {
  const auto seen = recognized(post(), 0.5 + M_PI);
  EXPECT_EQ(seen.name, "thing") << seen.reason;
  EXPECT_GT(seen.evidence.turn, 0.95);
}

TEST(Turn, IsNotSureWhereTheKnobIsHidden) {
  const auto hidden = recognized(post(), 0.5);
  if (hidden.name == "thing") {
    EXPECT_LT(hidden.evidence.turn, 0.9) << "it may be on either of the two sides behind";
    EXPECT_LE(hidden.score, hidden.evidence.turn);
  } else {
    EXPECT_NE(hidden.reason.find("may be turned over"), std::string::npos) << hidden.reason;
  }
}
