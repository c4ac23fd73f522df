#include "tabletop_perception/pick_scene.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "scene.h"
#include "tabletop_perception/train.h"

namespace tabletop_perception {
namespace {

ObjectModel modelOf(const std::string& name, const Mesh& mesh) {
  return trainFromMesh(name, mesh, DescriptorOptions(), {});
}

const ObjectModel& stepsModel() {
  static const ObjectModel model = modelOf("steps", scene::steppedBlock());
  return model;
}

/// What is made of a click on a scene's k-th object, on its pixel that is nearest to the middle of
/// those left of a column.
SceneObject recognizedAt(const scene::SyntheticScene& scene, std::size_t k, const ModelIndex& index,
                         const PipelineOptions& options, int columns = 640) {
  Indices seen;
  for (int i = 0; i < static_cast<int>(scene.truth.size()); ++i)
    if (scene.truth[i] == k + 2 && i % scene.cloud.width < columns) seen.push_back(i);
  const Eigen::Vector3f middle = centroidOf(pointsAt(scene.cloud, seen));
  const int nearest = *std::min_element(seen.begin(), seen.end(), [&](int a, int b) {
    return (scene.cloud.point(a) - middle).norm() < (scene.cloud.point(b) - middle).norm();
  });
  const auto pick = pickInScene(scene.cloud, scene.cloud.point(nearest), scene.up, options);
  if (!pick) {
    ADD_FAILURE() << pick.reason;
    return {};
  }
  return recognizePick(atFullResolution(scene.cloud, *pick), index, options);
}

void expectAt(const SceneObject& object, const scene::Placed& truth) {
  ASSERT_EQ(object.name, truth.name) << object.reason;
  const Eigen::Vector3d middle = centroidOf(truth.mesh.vertices).cast<double>();
  EXPECT_LT((object.T_camera_object * middle - truth.T_camera_object * middle).norm(), 0.005);
}

/// Clusters stay whole, however sharp their hollows.
PipelineOptions unsplit() {
  PipelineOptions options;
  options.split.enabled = false;
  return options;
}

/// What is matched by itself is a whole cluster.
PipelineOptions withoutParts(PipelineOptions options) {
  options.match.parts = false;
  return options;
}

TEST(RecognizePick, whatResemblesNothingIsCutAtShallowerHollows) {
  const auto scene = scene::render({{"steps", scene::steppedBlock(), scene::standing(0, 0.07, 0.9)},
                                    {"ball", scene::ball(0.06), scene::standing(0.01, -0.05, 0)}});
  const ModelIndex index({stepsModel()});
  PipelineOptions options = withoutParts(PipelineOptions());
  options.match.stands = false;
  options.split.concave_angle_deg = 80;
  expectAt(recognizedAt(scene, 0, index, options), scene.objects[0]);
  options.split.enabled = false;
  EXPECT_EQ(recognizedAt(scene, 0, index, options).name, "unknown");
}

TEST(RecognizePick, aPieceIsKnownByTheOneOnTheOtherSideOfWhatHidesTheMiddle) {
  const auto scene =
      scene::render({{"steps", scene::steppedBlock(), scene::standing(0.05, 0, 2.8)},
                     {"post", scene::box(0.02, 0.03, 0.25), scene::standing(-0.1, 0, 0)}});
  const int columns = scene.cloud.width / 2;  // up to the post
  expectAt(recognizedAt(scene, 0, ModelIndex({stepsModel()}), PipelineOptions(), columns),
           scene.objects[0]);
}

/// Of some objects the models.
ModelIndex modelsOf(const std::vector<scene::Placed>& objects) {
  std::vector<ObjectModel> models;
  for (const auto& object : objects) models.push_back(modelOf(object.name, object.mesh));
  return ModelIndex(std::move(models));
}

TEST(RecognizePick, whatAKnownThingBesideItLeavesIsLookedAtByItself) {
  const auto scene =
      scene::render({{"wide", scene::box(0.07, 0.13, 0.05), scene::standing(0, 0.065, 0)},
                     {"tall", scene::box(0.05, 0.08, 0.11), scene::standing(0, -0.041, 0)}});
  const ModelIndex index = modelsOf(scene.objects);
  for (std::size_t k = 0; k < 2; ++k)
    expectAt(recognizedAt(scene, k, index, unsplit()), scene.objects[k]);
}

/// Three boxes in a row, of which each is too little of their cluster.
scene::SyntheticScene threeBoxes() {
  return scene::render({{"wide", scene::box(0.07, 0.12, 0.05), scene::standing(0, 0.121, 0)},
                        {"tall", scene::box(0.05, 0.08, 0.11), scene::standing(0, 0.02, 0)},
                        {"cube", scene::box(0.09, 0.09, 0.08), scene::standing(0, -0.066, 0)}});
}

TEST(RecognizePick, theFacesOfSeveralThingsInOneClusterTellThem) {
  const auto scene = threeBoxes();
  const ModelIndex index = modelsOf(scene.objects);
  for (std::size_t k = 0; k < 3; ++k)
    expectAt(recognizedAt(scene, k, index, withoutParts(unsplit())), scene.objects[k]);
}

TEST(RecognizePick, aModelThatMayStandAtThePointCutsItsThingOut) {
  const auto scene =
      scene::render({{"brick", scene::box(0.05, 0.08, 0.06), scene::standing(0, -0.041, 0)},
                     {"tall", scene::box(0.06, 0.07, 0.12), scene::standing(0, 0.035, 0)}});
  const ModelIndex index({modelOf("brick", scene.objects[0].mesh)});
  PipelineOptions options = withoutParts(unsplit());
  expectAt(recognizedAt(scene, 0, index, options), scene.objects[0]);
  options.match.stands = false;
  EXPECT_EQ(recognizedAt(scene, 0, index, options).name, "unknown");
}

TEST(RecognizePick, aSingleFaceTellsNothing) {
  const auto scene = threeBoxes();
  PipelineOptions options = withoutParts(unsplit());
  options.match.stands = false;
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_EQ(recognizedAt(scene, k, modelsOf({scene.objects[k]}), options).name, "unknown");
}

}  // namespace
}  // namespace tabletop_perception
