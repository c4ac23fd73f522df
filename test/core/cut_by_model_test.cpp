#include "cut_by_model.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "stands_at_point.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/symmetry.h"
#include "tabletop_perception/train.h"

#include "views.h"

using namespace tabletop_perception;

namespace {

ObjectModel modelOf(const std::string& name, const Mesh& mesh) {
  return trainFromMesh(name, mesh, DescriptorOptions(), {});
}

/// Things on a table that touch each other, of which some were taught.
class Touching {
 public:
  Touching(const std::vector<scene::Standing>& objects, std::vector<ObjectModel> taught)
      : scene_(scene::render(objects)), index_(std::move(taught)) {
    for (int i = 0; i < static_cast<int>(scene_.truth.size()); ++i)
      if (scene_.truth[i] >= 2) standing_.push_back(i);
    table_.plane = scene_.plane;
    table_.T_camera_table = scene_.T_camera_table;
  }

  /// The pixel of the k-th object nearest to the middle of all of them.
  Eigen::Vector3f pointOf(std::size_t k) const {
    const auto points = pointsAt(scene_.cloud, pixelsOf(k));
    const Eigen::Vector3f middle = centroidOf(points);
    return *std::min_element(points.begin(), points.end(), [&](const auto& a, const auto& b) {
      return (a - middle).norm() < (b - middle).norm();
    });
  }

  std::vector<ModelCut> cutsAt(std::size_t k) const {
    return cutsByModels(observe(scene_.cloud, &table_, scene::SceneOptions().projection), standing_,
                        pointOf(k), index_, RefineOptions());
  }

  /// Of a cut and the k-th object.
  double iou(const ModelCut& cut, std::size_t k) const {
    const Indices truth = pixelsOf(k);
    Indices both;
    std::set_intersection(truth.begin(), truth.end(), cut.points.begin(), cut.points.end(),
                          std::back_inserter(both));
    return static_cast<double>(both.size()) /
           static_cast<double>(truth.size() + cut.points.size() - both.size());
  }

 protected:
  Indices pixelsOf(std::size_t k) const {
    Indices pixels;
    for (const int i : standing_)
      if (scene_.truth[i] == k + 2) pixels.push_back(i);
    return pixels;
  }

  scene::SyntheticScene scene_;
  ModelIndex index_;
  Indices standing_;
  Table table_;
};

/// Whether all points within 1.5 cm of the i-th face as it does.
bool isFlatAbout(const Surface& surface, std::size_t i) {
  for (std::size_t j = 0; j < surface.size(); ++j)
    if ((surface.points[j] - surface.points[i]).norm() < 0.015f &&
        surface.normals[j].dot(surface.normals[i]) < 0.98f)
      return false;
  return true;
}

Mesh brick() { return scene::box(0.05, 0.08, 0.06); }

}  // namespace

TEST(CutByModel, IsWhatTheModelAtThePointExplains) {
  const Touching things({{"brick", brick(), scene::standing(0, -0.041, 0)},
                         {"tall", scene::box(0.06, 0.07, 0.12), scene::standing(0, 0.035, 0)}},
                        {modelOf("brick", brick())});
  const auto cuts = things.cutsAt(0);
  ASSERT_FALSE(cuts.empty());
  EXPECT_EQ(cuts.front().name, "brick");
  EXPECT_GT(things.iou(cuts.front(), 0), 0.8);
}

TEST(CutByModel, IsNotMadeThroughASurfaceThatGoesOn) {
  const Touching things({{"bar", scene::box(0.05, 0.30, 0.06), scene::standing(0, 0, 0)}},
                        {modelOf("brick", brick())});
  EXPECT_TRUE(things.cutsAt(0).empty());
}

TEST(CutByModel, NeedsAModelThatStandsAsHighAsThePoint) {
  const Touching things({{"tower", scene::box(0.05, 0.08, 0.25), scene::standing(0, 0, 0)}},
                        {modelOf("plate", scene::box(0.10, 0.12, 0.02))});
  EXPECT_TRUE(things.cutsAt(0).empty());
}

TEST(StandsAtPoint, ShowThePointAndStandOnTheTable) {
  const auto scene = scene::render({{"house", scene::house(), scene::standing(0.02, 0.05, 0.7)}});
  const ModelIndex index({modelOf("house", scene::house())});
  Table table;
  table.plane = scene.plane;
  table.T_camera_table = scene.T_camera_table;
  Indices seen;
  for (int i = 0; i < static_cast<int>(scene.truth.size()); ++i)
    if (scene.truth[i] == 2) seen.push_back(i);
  const Surface surface =
      sampleSurface(pointsAt(scene.cloud, seen), 0.005, 0.01, Eigen::Vector3f::Zero());
  const auto& truth = scene.objects[0].T_camera_object;
  const auto observation = observe(scene.cloud, &table, scene::SceneOptions().projection);
  int looked = 0, right = 0;
  for (std::size_t i = 0; i < surface.size(); i += surface.size() / 40) {
    if (!isFlatAbout(surface, i)) continue;
    ++looked;
    const auto stands = standsAt(surface.points[i], surface.normals[i], observation, index, 3);
    EXPECT_LE(stands.size(), 3u);
    if (stands.empty()) continue;
    const Eigen::Isometry3d between = truth.inverse() * stands.front().T_camera_object;
    right += between.translation().norm() < 0.02 && angleOf(between.linear()) < 0.2;
  }
  EXPECT_GT(looked, 10);
  EXPECT_GT(right, 0.8 * looked) << "of " << looked;
  const auto noneWith = [&](const Table* known, const std::optional<Projection>& camera) {
    return standsAt(surface.points[0], surface.normals[0], observe(scene.cloud, known, camera),
                    index, 3)
        .empty();
  };
  EXPECT_TRUE(noneWith(nullptr, scene::SceneOptions().projection));
  EXPECT_TRUE(noneWith(&table, std::nullopt));
}
