#include "tabletop_perception/pick_scene.h"

#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scene.h"
#include "tabletop_perception/train.h"

namespace tabletop_perception {
namespace {

ObjectModel modelOf(const std::string& name, const Mesh& mesh) {
  return trainFromMesh(name, mesh, DescriptorOptions(), {});
}

const ObjectModel& bracketModel() {
  static const ObjectModel model = modelOf("bracket", scene::bracket());
  return model;
}

const ObjectModel& stepsModel() {
  static const ObjectModel model = modelOf("steps", scene::steppedBlock());
  return model;
}

const ObjectModel& houseModel() {
  static const ObjectModel model = modelOf("house", scene::house());
  return model;
}

/// What is made of a click on a scene's k-th object, on the pixel of it nearest to the middle of
/// its pixels.
SceneObject recognizedAt(const scene::SyntheticScene& scene, std::size_t k, const ModelIndex& index,
                         const PipelineOptions& options) {
  Indices truth;
  for (std::size_t i = 0; i < scene.truth.size(); ++i)
    if (scene.truth[i] == k + 2) truth.push_back(static_cast<int>(i));
  const Eigen::Vector3f middle = centroidOf(pointsAt(scene.cloud, truth));
  Eigen::Vector3f point = scene.cloud.point(truth.front());
  for (const int i : truth)
    if ((scene.cloud.point(i) - middle).norm() < (point - middle).norm())
      point = scene.cloud.point(i);
  const auto pick = pickInScene(scene.cloud, point, scene.up, options);
  if (!pick) {
    ADD_FAILURE() << pick.reason;
    return {};
  }
  return recognizePick(atFullResolution(filterCloud(scene.cloud, options.filter), *pick), index,
                       options);
}

void expectAt(const SceneObject& object, const scene::Placed& truth) {
  ASSERT_EQ(object.name, truth.name) << object.reason;
  EXPECT_LT((object.T_camera_object.translation() - truth.T_camera_object.translation()).norm(),
            0.005);
}

/// Clusters stay whole, however sharp their hollows.
PipelineOptions unsplit() {
  PipelineOptions options;
  options.split.enabled = false;
  return options;
}

/// A bracket against an unknown thing.
scene::SyntheticScene bracketAtBall() {
  return scene::render({{"bracket", scene::bracket(), scene::standing(0, 0.02, 0.9)},
                        {"ball", scene::ball(0.05), scene::standing(0.02, -0.085, 0)}});
}

TEST(RecognizePick, whatResemblesNothingIsCutAtShallowerHollows) {
  const auto scene = bracketAtBall();
  PipelineOptions options;
  options.split.concave_angle_deg = 80;
  expectAt(recognizedAt(scene, 0, ModelIndex({bracketModel()}), options), scene.objects[0]);
}

TEST(RecognizePick, whatKnownThingsAroundItLeaveIsLookedAtByItself) {
  const auto scene =
      scene::render({{"bracket", scene::bracket(), scene::standing(-0.02, 0.09, 2.5)},
                     {"house", scene::house(), scene::standing(0.06, 0.0, -0.6)},
                     {"steps", scene::steppedBlock(), scene::standing(0.0, -0.1, 2.4)}});
  const ModelIndex index({bracketModel(), houseModel(), stepsModel()});
  for (std::size_t k = 0; k < 3; ++k)
    expectAt(recognizedAt(scene, k, index, unsplit()), scene.objects[k]);
}

TEST(RecognizePick, aPieceIsKnownByTheOthersBeyondWhatHidesItsMiddle) {
  const auto scene =
      scene::render({{"house", scene::house(), scene::standing(0.05, 0, 1.4)},
                     {"post", scene::box(0.02, 0.05, 0.2), scene::standing(-0.1, 0, 0)}});
  expectAt(recognizedAt(scene, 0, ModelIndex({houseModel()}), PipelineOptions()), scene.objects[0]);
}

TEST(RecognizePick, aSmoothFaceAtThePointIsLookedAtByItself) {
  const Mesh box = scene::box(0.12, 0.06, 0.15);
  const auto scene = scene::render({{"box", box, scene::standing(0, 0.02, 0.9)},
                                    {"ball", scene::ball(0.07), scene::standing(0.02, -0.115, 0)}});
  expectAt(recognizedAt(scene, 0, ModelIndex({modelOf("box", box)}), unsplit()), scene.objects[0]);
}

}  // namespace
}  // namespace tabletop_perception
