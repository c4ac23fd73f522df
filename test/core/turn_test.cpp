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

}  // namespace

TEST(Turn, OfABoxWithClearlyDifferentSidesIsSure) {
  const auto box = recognized(scene::box(0.06, 0.10, 0.15), 0.5);
  EXPECT_EQ(box.name, "thing") << box.reason;
  EXPECT_GT(box.evidence.turn, 0.95) << "half turns are its symmetry";
}
