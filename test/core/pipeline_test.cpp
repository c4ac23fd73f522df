#include "tabletop_perception/pipeline.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "scene.h"
#include "tabletop_perception/train.h"

using namespace tabletop_perception;

namespace {

constexpr double DEG = M_PI / 180;

const ModelIndex& threeModels() {
  static const ModelIndex index = [] {
    std::vector<ObjectModel> models;
    for (const auto& object : scene::threeObjects().objects)
      models.push_back(trainFromMesh(object.name, object.mesh, DescriptorOptions(), {}));
    return ModelIndex(std::move(models));
  }();
  return index;
}

scene::SyntheticScene threeObjectsWithNoise() {
  scene::SceneOptions options;
  options.noise = 0.001;
  return scene::threeObjects(options);
}

/// Clusters stay whole: the objects of these scenes have hollows, at which they would be cut.
PipelineOptions unsplit() {
  PipelineOptions options;
  options.split.enabled = false;
  return options;
}

Recognition recognized(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                       const PipelineOptions& options = PipelineOptions()) {
  return recognizeScene(cloud, up, threeModels(), options);
}

/// Every object of the scene was found once, where it is after the scene was moved by `T`, and
/// nothing else.
void expectAllFound(const Recognition& recognition, const scene::SyntheticScene& scene,
                    const Eigen::Isometry3d& T = Eigen::Isometry3d::Identity()) {
  const auto known =
      std::count_if(recognition.objects.begin(), recognition.objects.end(),
                    [](const SceneObject& object) { return object.name != "unknown"; });
  EXPECT_EQ(known, static_cast<std::ptrdiff_t>(scene.objects.size()));
  for (const auto& truth : scene.objects) {
    const auto found =
        std::find_if(recognition.objects.begin(), recognition.objects.end(),
                     [&](const SceneObject& object) { return object.name == truth.name; });
    if (found == recognition.objects.end()) {
      for (const auto& object : recognition.objects)
        ADD_FAILURE() << truth.name << " not found; there is " << object.name << " ("
                      << object.reason << ")";
      continue;
    }
    const Eigen::Isometry3d pose = T * truth.T_camera_object;
    const Eigen::Vector3d middle = centroidOf(truth.mesh.vertices).cast<double>();
    EXPECT_LT((found->T_camera_object * middle - pose * middle).norm(), 0.003) << truth.name;
    EXPECT_LT((found->T_camera_object.translation() - pose.translation()).norm(), 0.003)
        << truth.name;
    EXPECT_LT(angleOf(found->T_camera_object.linear().transpose() * pose.linear()) / DEG, 2)
        << truth.name;
    EXPECT_GT(found->score, PipelineOptions().verify.min_score);
    EXPECT_LE(found->score, 1);
    EXPECT_GT(found->visible, 0.5);
    EXPECT_LT(found->fitness, 0.004);
    EXPECT_EQ(found->reason, "");
  }
}

}  // namespace

TEST(Segmentation, LabelsArePixelsOfTheTruth) {
  const auto scene = threeObjectsWithNoise();
  const Segmentation result = segmentScene(scene.cloud, scene.up, unsplit());
  EXPECT_EQ(result.reason, "");
  ASSERT_TRUE(result.table);
  ASSERT_EQ(result.clusters.size(), 3u);
  const auto labels = result.labels();
  ASSERT_EQ(labels.size(), scene.cloud.size());
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& cluster = result.clusters[k];
    const auto object = scene.truth[cluster.front()];
    const auto own = std::count_if(cluster.begin(), cluster.end(),
                                   [&](int i) { return scene.truth[i] == object; });
    const auto all = std::count(scene.truth.begin(), scene.truth.end(), object);
    EXPECT_EQ(static_cast<std::size_t>(own), cluster.size());
    EXPECT_GT(own, 0.9 * all);
    for (const int i : cluster) EXPECT_EQ(labels[i], k + 2);
  }
  EXPECT_TRUE(result.clusters[0].size() >= result.clusters[1].size() &&
              result.clusters[1].size() >= result.clusters[2].size());
  for (const std::string stage : {"filter", "table", "cluster", "total"})
    EXPECT_EQ(result.times_ms.count(stage), 1u) << stage;
}

TEST(Segmentation, WorksWithoutTheGrid) {
  const auto scene = threeObjectsWithNoise();
  const Cloud packed = selectPoints(scene.cloud, validIndices(scene.cloud));
  EXPECT_EQ(segmentScene(packed, scene.up, PipelineOptions()).clusters.size(), 3u);
  PipelineOptions options;
  options.filter.leaf_size = 0.004;
  options.cluster.min_points = 100;
  const Segmentation thinned = segmentScene(scene.cloud, scene.up, options);
  EXPECT_EQ(thinned.clusters.size(), 3u) << thinned.reason;
  EXPECT_EQ(thinned.labels().size(), thinned.filtered.size());
}

TEST(Segmentation, SaysWhyThereIsNothing) {
  const Segmentation blind = segmentScene(Cloud(64, 48, true), std::nullopt, PipelineOptions());
  EXPECT_FALSE(blind.table);
  EXPECT_EQ(blind.reason, "the cloud has no valid point");
  EXPECT_EQ(blind.labels(), std::vector<std::uint32_t>(64 * 48, 0));

  const auto bare_scene = scene::render({});
  const Segmentation bare = segmentScene(bare_scene.cloud, bare_scene.up, PipelineOptions());
  EXPECT_TRUE(bare.table);
  EXPECT_TRUE(bare.clusters.empty());
  EXPECT_EQ(bare.reason, "nothing stands on it");
}

TEST(Pipeline, FindsThreeObjectsWhereTheyAre) {
  const auto scene = threeObjectsWithNoise();
  const Recognition recognition = recognized(scene.cloud, scene.up);
  expectAllFound(recognition, scene);
  ASSERT_EQ(recognition.objects.size(), 3u);
  for (std::size_t k = 0; k < recognition.objects.size(); ++k) {
    const auto& object = recognition.objects[k];
    std::size_t points = 0;
    for (const auto label : object.labels)
      points += recognition.segmentation.clusters.at(label - 2).size();
    EXPECT_EQ(object.points, static_cast<int>(points));
    EXPECT_GT(object.box.size[2], 0.02);
  }
  for (const std::string stage : {"filter", "table", "cluster", "match", "refine", "total"})
    EXPECT_EQ(recognition.times_ms.count(stage), 1u) << stage;
}

TEST(Pipeline, FindsThemThoughTheirHollowsCutThemApart) {
  PipelineOptions options;
  options.split.enabled = true;
  const auto scene = threeObjectsWithNoise();
  const Recognition recognition = recognized(scene.cloud, scene.up, options);
  expectAllFound(recognition, scene);
  for (const auto& cluster : recognition.segmentation.clusters)
    for (const int i : cluster) ASSERT_EQ(scene.truth[i], scene.truth[cluster.front()]);
}

TEST(Pipeline, FindsThemWithoutKnowingUp) {
  const auto scene = threeObjectsWithNoise();
  expectAllFound(recognized(scene.cloud, std::nullopt), scene);
}

TEST(Pipeline, TurnsWithTheSceneIntoACameraThatLooksAlongNegativeZ) {
  const auto scene = threeObjectsWithNoise();
  const Eigen::Isometry3d T = clouds::motion(180, {1, 0, 0}, {0, 0, 0});
  expectAllFound(recognized(clouds::turned(scene.cloud, T), T.linear() * scene.up), scene, T);
}

TEST(Pipeline, TurnsWithTheObjectsOnTheTable) {
  const scene::SceneOptions options;
  for (const double yaw : {0.9, 2.1, 3.8}) {
    std::vector<scene::Standing> moved;
    for (const auto& object : scene::threeObjects().objects) {
      const double y = 0.25 * (static_cast<double>(moved.size()) - 1);
      moved.push_back({object.name, object.mesh, scene::standing(0.03, y, yaw + y)});
    }
    const auto scene = scene::render(moved, options);
    SCOPED_TRACE(yaw);
    expectAllFound(recognized(scene.cloud, scene.up), scene);
  }
}

TEST(Pipeline, WorksWithoutTheGrid) {
  const auto scene = threeObjectsWithNoise();
  const Cloud packed = selectPoints(scene.cloud, validIndices(scene.cloud));
  expectAllFound(recognized(packed, scene.up), scene);
}

TEST(Pipeline, SameInputSameAnswer) {
  const auto scene = threeObjectsWithNoise();
  const Recognition once = recognized(scene.cloud, scene.up);
  const Recognition again = recognized(scene.cloud, scene.up);
  ASSERT_EQ(once.objects.size(), again.objects.size());
  for (std::size_t k = 0; k < once.objects.size(); ++k) {
    EXPECT_EQ(once.objects[k].name, again.objects[k].name);
    EXPECT_EQ(once.objects[k].score, again.objects[k].score);
    EXPECT_EQ(once.objects[k].T_camera_object.matrix(), again.objects[k].T_camera_object.matrix());
  }
}

TEST(Pipeline, WhatIsNotInTheDatabaseStaysUnknown) {
  const auto scene = scene::render({{"ball", scene::ball(0.05), scene::standing(0.05, 0.2, 0)},
                                    {"can", scene::cylinder(0.035, 0.12), scene::standing(0, 0, 0)},
                                    {"house", scene::painted(scene::house(), scene::HOUSE_COLOR),
                                     scene::standing(0.02, -0.25, 1)}});
  const Recognition recognition = recognized(scene.cloud, scene.up);
  ASSERT_EQ(recognition.objects.size(), 3u);
  int known = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& object = recognition.objects[k];
    const auto label = scene.truth[recognition.segmentation.clusters[k].front()];
    const std::string truth = scene.objects[label - 2].name;
    if (truth == "house") {
      EXPECT_EQ(object.name, "house") << object.reason;
      ++known;
      continue;
    }
    EXPECT_EQ(object.name, "unknown") << "for the " << truth << ", score " << object.score;
    EXPECT_NE(object.reason, "");
    EXPECT_EQ(object.score, 0);
    EXPECT_EQ(object.T_camera_object.matrix(), object.box.T_camera_box.matrix());
    // Upright: one axis of the box is up.
    const Eigen::Vector3d along = object.box.T_camera_box.linear().transpose() * scene.up;
    EXPECT_GT(along.cwiseAbs().maxCoeff(), std::cos(0.5 * DEG));
  }
  EXPECT_EQ(known, 1);
}

TEST(Pipeline, AModelLargerThanTheSceneIsNotFoundAndHindersNothing) {
  const auto scene = scene::render({{"house", scene::house(), scene::standing(0, 0.1, 1)}});
  const auto learnt = [](const std::string& name, const Mesh& mesh) {
    return trainFromMesh(name, mesh, DescriptorOptions(), {});
  };
  const ModelIndex models(
      {learnt("beam", scene::box(1.6, 0.1, 0.1)), learnt("house", scene::house())});
  const Recognition recognition = recognizeScene(scene.cloud, scene.up, models, unsplit());
  ASSERT_EQ(recognition.objects.size(), 1u);
  EXPECT_EQ(recognition.objects[0].name, "house") << recognition.objects[0].reason;
}

TEST(Pipeline, WithoutADatabaseEverythingIsUnknown) {
  const auto scene = threeObjectsWithNoise();
  const Recognition recognition = recognizeScene(scene.cloud, scene.up, ModelIndex(), unsplit());
  ASSERT_EQ(recognition.objects.size(), 3u);
  for (const auto& object : recognition.objects) {
    EXPECT_EQ(object.name, "unknown");
    EXPECT_EQ(object.reason, "the database holds no object");
  }
}

TEST(Pipeline, TheStagesOneByOneSayTheSame) {
  const auto scene = threeObjectsWithNoise();
  const PipelineOptions options = unsplit();
  const Recognition whole = recognized(scene.cloud, scene.up);
  const Segmentation& segmentation = whole.segmentation;
  const auto proposals = proposeObjects(segmentation.filtered, segmentation.clusters,
                                        segmentation.tables(), threeModels(), options.match);
  const auto objects =
      decideObjects(segmentation.filtered, segmentation.clusters, proposals, segmentation.tables(),
                    threeModels(), options.match, options.refine, options.verify);
  ASSERT_EQ(objects.size(), whole.objects.size());
  for (std::size_t k = 0; k < objects.size(); ++k) {
    EXPECT_EQ(objects[k].name, whole.objects[k].name);
    EXPECT_EQ(objects[k].T_camera_object.matrix(), whole.objects[k].T_camera_object.matrix());
  }
}

TEST(Pipeline, TwoThreadsProposeTheSameToTheLastBit) {
  const auto scene = threeObjectsWithNoise();
  const Segmentation segmentation = segmentScene(scene.cloud, scene.up, unsplit());
  ASSERT_GT(segmentation.clusters.size(), 1u);
  const auto proposed = [&](int threads) {
    MatchOptions options;
    options.threads = threads;
    return proposeObjects(segmentation.filtered, segmentation.clusters, segmentation.tables(),
                          threeModels(), options);
  };
  const auto one = proposed(1), two = proposed(2);
  ASSERT_EQ(two.size(), one.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_EQ(two[k].labels, one[k].labels);
    EXPECT_EQ(two[k].candidates.reason, one[k].candidates.reason);
    ASSERT_TRUE(one[k].candidates && two[k].candidates);
    ASSERT_EQ(two[k].candidates->size(), one[k].candidates->size());
    for (std::size_t c = 0; c < one[k].candidates->size(); ++c) {
      const Candidate &a = one[k].candidates->at(c), &b = two[k].candidates->at(c);
      EXPECT_EQ(b.name, a.name);
      EXPECT_EQ(b.promise, a.promise);
      EXPECT_EQ(b.distance, a.distance);
      EXPECT_EQ(b.T_camera_object.matrix(), a.T_camera_object.matrix());
    }
  }
}

TEST(Pipeline, CandidatesThatLeftTheDatabaseMeanwhileAreNotAnswered) {
  const auto scene = threeObjectsWithNoise();
  const Segmentation segmentation = segmentScene(scene.cloud, scene.up, PipelineOptions());
  ASSERT_FALSE(segmentation.clusters.empty());
  const std::vector<Candidate> gone{{"teapot", 0, 0, Eigen::Isometry3d::Identity()}};
  const auto objects = decideObjects(segmentation.filtered, {segmentation.clusters[0]},
                                     {{{2}, gone}}, segmentation.tables(), threeModels(),
                                     MatchOptions(), RefineOptions(), VerifyOptions());
  ASSERT_EQ(objects.size(), 1u);
  EXPECT_EQ(objects[0].name, "unknown");
  EXPECT_NE(objects[0].reason, "");
}
