#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "scene.h"
#include "tabletop_perception/object_memory.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/symmetry.h"
#include "tabletop_perception/train.h"

/// What is used of the frame before: candidates of clusters that stay as they are, and known
/// objects where they were.
namespace tabletop_perception {
namespace {

constexpr double KEEP = 2;  // [s]

std::vector<scene::Placed> things() { return scene::threeObjects().objects; }

const ModelIndex& threeModels() {
  static const ModelIndex index = [] {
    std::vector<ObjectModel> models;
    for (const auto& object : things())
      models.push_back(trainFromMesh(object.name, object.mesh, DescriptorOptions(), {}));
    return ModelIndex(std::move(models));
  }();
  return index;
}

scene::SyntheticScene seen(const std::vector<scene::Standing>& standing, unsigned seed) {
  scene::SceneOptions options;
  options.noise = 0.001;
  options.seed = seed;
  return scene::render(standing, options);
}

const scene::Standing BRACKET{"bracket", scene::painted(scene::bracket(), scene::BRACKET_COLOR),
                              scene::standing(0.02, 0.25, 2.5)};

/// The house beside a bracket, which stays where it is.
scene::SyntheticScene houseAt(double x, double y, double yaw, unsigned seed) {
  return seen(
      {{"house", scene::painted(scene::house(), scene::HOUSE_COLOR), scene::standing(x, y, yaw)},
       BRACKET},
      seed);
}

/// A scene cut into clusters: the objects have hollows, at which they would be split.
Segmentation segmented(const scene::SyntheticScene& scene) {
  PipelineOptions options;
  options.split.enabled = false;
  return segmentScene(scene.cloud, scene.up, options);
}

std::vector<Proposal> proposed(const Segmentation& s, double stamp, ProposalMemory& memory) {
  MatchOptions options;
  options.keep = KEEP;
  return proposeObjects(s.filtered, s.clusters, s.tables(), threeModels(), options, stamp, memory);
}

std::vector<SceneObject> decided(const Segmentation& s, const std::vector<Proposal>& proposals,
                                 const std::vector<SceneObject>& expected) {
  return decideObjects(s.filtered, s.clusters, proposals, s.tables(), threeModels(), MatchOptions(),
                       RefineOptions(), VerifyOptions(), expected);
}

std::vector<SceneObject> decided(const Segmentation& s, const std::vector<SceneObject>& expected) {
  ProposalMemory none;
  return decided(s, proposed(s, 0, none), expected);
}

const SceneObject* find(const std::vector<SceneObject>& objects, const std::string& name) {
  for (const auto& object : objects)
    if (object.name == name) return &object;
  return nullptr;
}

/// Of the proposals that are those of the frame before to the last bit, how many.
int kept(const std::vector<Proposal>& before, const std::vector<Proposal>& now) {
  int count = 0;
  for (const auto& proposal : now)
    count += std::any_of(before.begin(), before.end(), [&](const Proposal& other) {
      return other.candidates && proposal.candidates && !proposal.candidates->empty() &&
             other.candidates->size() == proposal.candidates->size() &&
             other.candidates->front().T_camera_object.matrix() ==
                 proposal.candidates->front().T_camera_object.matrix();
    });
  return count;
}

TEST(ProposalMemory, ClustersThatStayKeepTheirCandidates) {
  ProposalMemory memory;
  const auto first = proposed(segmented(houseAt(0, 0, 0.4, 1)), 10, memory);
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(kept(first, proposed(segmented(houseAt(0, 0, 0.4, 2)), 10.1, memory)), 2);
  EXPECT_EQ(kept(first, proposed(segmented(houseAt(0, 0, 0.4, 3)), 11.9, memory)), 2)
      << "since the first frame";
}

TEST(ProposalMemory, AfterTheirTimeTheyAreMatchedAnew) {
  ProposalMemory memory;
  const auto first = proposed(segmented(houseAt(0, 0, 0.4, 1)), 10, memory);
  proposed(segmented(houseAt(0, 0, 0.4, 2)), 11, memory);
  EXPECT_EQ(kept(first, proposed(segmented(houseAt(0, 0, 0.4, 3)), 12.1, memory)), 0);
}

TEST(ProposalMemory, OnlyTheClusterThatMovesIsMatchedAnew) {
  ProposalMemory memory;
  const auto first = proposed(segmented(houseAt(0, 0, 0.4, 1)), 10, memory);
  EXPECT_EQ(kept(first, proposed(segmented(houseAt(0.02, 0, 0.4, 2)), 10.1, memory)), 1);
}

TEST(ProposalMemory, AThingThatTurnsIsMatchedAnew) {
  ProposalMemory memory;
  const auto first = proposed(segmented(houseAt(0, 0, 0.4, 1)), 10, memory);
  EXPECT_EQ(kept(first, proposed(segmented(houseAt(0, 0, 0.7, 2)), 10.1, memory)), 1);
}

TEST(ProposalMemory, AThingThatCreepsIsMatchedAnewInTime) {
  ProposalMemory memory;
  auto first = proposed(segmented(houseAt(0, 0, 0.4, 1)), 10, memory);
  int steps = 0;
  for (; steps < 8; ++steps)
    if (kept(first, proposed(segmented(houseAt(0.002 * (steps + 1), 0, 0.4, 2)), 10.1, memory)) < 2)
      break;
  EXPECT_LE(steps, 4) << "2 mm each";
}

TEST(ProposalMemory, AnEarlierStampFindsNothing) {
  ProposalMemory memory;
  const auto first = proposed(segmented(houseAt(0, 0, 0.4, 1)), 10, memory);
  EXPECT_EQ(kept(first, proposed(segmented(houseAt(0, 0, 0.4, 2)), 9, memory)), 0);
}

class Followed : public testing::Test {
 protected:
  static const std::vector<SceneObject>& before() {
    static const auto objects = decided(segmented(houseAt(0, 0, 0.4, 1)), {});
    return objects;
  }

  static void expectAt(const SceneObject* object, const scene::SyntheticScene& scene) {
    ASSERT_TRUE(object);
    for (const auto& truth : scene.objects) {
      if (truth.name != object->name) continue;
      EXPECT_TRUE(
          samePose(Symmetry(), object->T_camera_object, truth.T_camera_object, 0.002, 0.02));
    }
  }
};

TEST_F(Followed, WhatStaysIsFollowedWithoutCandidates) {
  ASSERT_EQ(before().size(), 2u);
  const auto scene = houseAt(0, 0, 0.4, 2);
  const auto objects = decided(segmented(scene), {}, before());
  ASSERT_EQ(objects.size(), 2u);
  for (const auto& object : objects) {
    ASSERT_TRUE(object.followed) << object.name << " " << object.reason;
    EXPECT_EQ(before()[*object.followed].name, object.name);
    EXPECT_EQ(before()[*object.followed].evidence.turn, object.evidence.turn);
    EXPECT_NEAR(before()[*object.followed].score, object.score, 0.1);
    expectAt(&object, scene);
  }
}

TEST_F(Followed, WhatIsTakenAwayIsNot) {
  const auto objects = decided(segmented(seen({BRACKET}, 2)), before());
  EXPECT_FALSE(find(objects, "house"));
  EXPECT_TRUE(find(objects, "bracket"));
}

TEST_F(Followed, WhatIsMovedIsDecidedAnew) {
  const auto scene = houseAt(0.05, -0.03, 0.9, 2);
  const auto objects = decided(segmented(scene), before());
  const auto* house = find(objects, "house");
  expectAt(house, scene);
  EXPECT_FALSE(house->followed);
  EXPECT_TRUE(find(objects, "bracket")->followed);
}

TEST_F(Followed, WhatIsTurnedInItsPlaceIsDecidedAnew) {
  const auto scene = houseAt(0, 0, 0.4 + M_PI / 2, 2);
  expectAt(find(decided(segmented(scene), before()), "house"), scene);
}

TEST_F(Followed, AnotherThingInItsPlaceIsNoticed) {
  const auto scene = seen({{"steps", scene::painted(scene::steppedBlock(), scene::STEPS_COLOR),
                            scene::standing(0, 0, 0.4)}},
                          2);
  const auto objects = decided(segmented(scene), before());
  EXPECT_FALSE(find(objects, "house"));
  expectAt(find(objects, "steps"), scene);
}

SceneObject named(const std::string& name, double x) {
  SceneObject object;
  object.name = name;
  object.T_camera_object = Eigen::Translation3d(x, 0, 1);
  return object;
}

TEST(ObjectMemory, ExpectsNamedObjectsForTheirTime) {
  const auto still = Eigen::Isometry3d::Identity();
  ObjectMemory memory;
  EXPECT_TRUE(memory.expected(9, still, KEEP).empty());
  memory.remember(10, still, {named("house", 0), named("unknown", 1)});
  const auto expected = memory.expected(10.1, still, KEEP);
  ASSERT_EQ(expected.size(), 1u);
  EXPECT_EQ(expected[0].name, "house");
  EXPECT_TRUE(memory.expected(12, still, KEEP).empty());
  EXPECT_TRUE(memory.expected(10.1, still, 0).empty());
}

TEST(ObjectMemory, FollowingDoesNotProlongTheTime) {
  const auto still = Eigen::Isometry3d::Identity();
  ObjectMemory memory;
  memory.remember(10, still, {named("house", 0)});
  ASSERT_EQ(memory.expected(11, still, KEEP).size(), 1u);
  auto followed = named("house", 0);
  followed.followed = 0;
  memory.remember(11, still, {followed, named("mug", 1)});
  ASSERT_EQ(memory.expected(11.9, still, KEEP).size(), 2u);
  const auto expected = memory.expected(12.1, still, KEEP);
  ASSERT_EQ(expected.size(), 1u);
  EXPECT_EQ(expected[0].name, "mug");
}

TEST(ObjectMemory, ExpectsThingsWhereAMovedCameraSeesThem) {
  const Eigen::Isometry3d before(Eigen::Translation3d(0, 0, 0)),
      after(Eigen::Translation3d(0.1, 0, 0));
  ObjectMemory memory;
  memory.remember(10, before, {named("house", 0.5)});
  EXPECT_NEAR(memory.expected(10.1, after, KEEP)[0].T_camera_object.translation().x(), 0.4, 1e-9);
}

TEST(ObjectMemory, AnEarlierStampForgetsEverything) {
  const auto still = Eigen::Isometry3d::Identity();
  ObjectMemory memory;
  memory.remember(10, still, {named("house", 0)});
  EXPECT_TRUE(memory.expected(3, still, KEEP).empty());
  EXPECT_TRUE(memory.expected(10.1, still, KEEP).empty());
}

}  // namespace
}  // namespace tabletop_perception
