#include "tabletop_perception/match.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "trained_model.h"
#include "views.h"

using namespace tabletop_perception;

namespace {

constexpr double DEG = M_PI / 180;
constexpr double EXTENT = 0.1;  // about that of the views [m]

std::vector<float> randomHistogram(std::mt19937& random) {
  std::uniform_real_distribution<float> value(0, 1);
  std::vector<float> values(VFH_SIZE);
  for (float& v : values) v = std::max(0.0f, value(random) - 0.3f);
  return values;
}

/// Two objects with 30 views each, described at random.
std::vector<ObjectModel> randomModels() {
  std::mt19937 random(1);
  std::vector<ObjectModel> models;
  for (const std::string name : {"a", "b"}) {
    ObjectModel model = trainedModel();
    model.name = name;
    model.views.assign(30, model.views[0]);
    for (auto& view : model.views) {
      view.descriptors.clear();
      for (const std::string kind : {"vfh", "cvfh"})
        view.descriptors.push_back(
            {kind, randomHistogram(random), Eigen::Vector3f(0, 0.1f, random() % 10 + 1.0f), {}});
    }
    models.push_back(std::move(model));
  }
  return models;
}

const std::vector<std::pair<std::string, Mesh>>& shapes() {
  static const std::vector<std::pair<std::string, Mesh>> all{
      {"bracket", scene::bracket()}, {"house", scene::house()}, {"steps", scene::steppedBlock()}};
  return all;
}

const ModelIndex& trainedIndex() {
  static const ModelIndex index = [] {
    std::vector<ObjectModel> models;
    for (const auto& [name, mesh] : shapes())
      models.push_back(views::modelOf(name, mesh, icosphereDirections()));
    return ModelIndex(std::move(models));
  }();
  return index;
}

Surface houseFromTheSide() {
  const Mesh mesh = scene::house();
  return views::seen(mesh, views::lookAt(mesh, {1, 0.7, 0.8}, 0.9));
}

/// Candidates of a cluster that floats alone before the camera.
Found<std::vector<Candidate>> matched(const Surface& cluster, const ModelIndex& index,
                                      const MatchOptions& options) {
  Cloud scene(static_cast<int>(cluster.size()), 1, false);
  for (std::size_t i = 0; i < cluster.size(); ++i) scene.setPoint(i, cluster.points[i]);
  return matchCluster(cluster, observe(scene, std::nullopt), index, options);
}

std::string reasonOf(const Found<std::vector<Candidate>>& found) {
  EXPECT_FALSE(found);
  return found.reason;
}

}  // namespace

TEST(Match, DistancesByHand) {
  const float a[] = {1, 0, 4, 0}, b[] = {3, 0, 1, 2};
  EXPECT_DOUBLE_EQ(histogramDistance(a, b, 4, "l1"), 2 + 0 + 3 + 2);
  EXPECT_NEAR(histogramDistance(a, b, 4, "l2"), std::sqrt(4.0 + 9 + 4), 1e-6);
  EXPECT_NEAR(histogramDistance(a, b, 4, "chi_square"), 4 / 4.0 + 9 / 5.0 + 4 / 2.0, 1e-6);
  for (const std::string metric : {"l1", "l2", "chi_square"}) {
    EXPECT_EQ(histogramDistance(a, a, 4, metric), 0);
    EXPECT_EQ(histogramDistance(a, b, 4, metric), histogramDistance(b, a, 4, metric));
  }
  EXPECT_EQ(clouds::refusalOf([&] { histogramDistance(a, b, 4, "cosine"); }),
            "match.metric must be one of l1, l2, chi_square, got 'cosine'");
}

TEST(Match, NearestViewsAreThoseOfTheBruteForceVersion) {
  const auto models = randomModels();
  const ModelIndex index(models);
  std::mt19937 random(2);
  for (const std::string metric : {"l1", "l2", "chi_square"})
    for (const std::string kind : {"vfh", "cvfh"}) {
      const Descriptor query{kind, randomHistogram(random), {0.1f, 0.2f, 0.9f}, {}};
      MatchOptions options;
      options.metric = metric;
      options.neighbors = 7;
      options.max_distance = 1e6;
      std::vector<double> truth;
      const auto distanceTo = [&](const Descriptor& other) {
        return histogramDistance(query.values.data(), other.values.data(), VFH_SIZE, metric);
      };
      for (const auto& model : models)
        for (const auto& view : model.views)
          for (const auto& descriptor : view.descriptors)
            if (descriptor.kind == kind) truth.push_back(distanceTo(descriptor));
      std::sort(truth.begin(), truth.end());

      const auto neighbors = nearestViews(query, EXTENT, index, options);
      ASSERT_EQ(neighbors.size(), 7u);
      for (std::size_t i = 0; i < neighbors.size(); ++i) {
        EXPECT_NEAR(neighbors[i].distance, truth[i], 1e-4);
        const auto& view = models[neighbors[i].model].views[neighbors[i].view];
        const auto& descriptor = view.descriptors[kind == "vfh" ? 0 : 1];
        EXPECT_NEAR(distanceTo(descriptor), truth[i], 1e-4);
        EXPECT_EQ(neighbors[i].view_centroid, descriptor.centroid);
        EXPECT_EQ(neighbors[i].cluster_centroid, query.centroid);
      }

      options.max_distance = (truth[2] + truth[3]) / 2;
      EXPECT_EQ(nearestViews(query, EXTENT, index, options).size(), 3u);
      options.max_distance = 0;
      EXPECT_TRUE(nearestViews(query, EXTENT, index, options).empty());
    }
}

TEST(Match, OnlyEqualKindsAndLengthsAreCompared) {
  const ModelIndex index(randomModels());
  std::mt19937 random(2);
  Descriptor query{"esf", randomHistogram(random), {0, 0, 1}, {}};
  EXPECT_TRUE(nearestViews(query, EXTENT, index, MatchOptions()).empty());
  query.kind = "vfh";
  query.values.pop_back();
  EXPECT_TRUE(nearestViews(query, EXTENT, index, MatchOptions()).empty());
}

TEST(Match, AClusterThatIsTheViewHasTheViewsPose) {
  View view;
  view.T_view_object = clouds::motion(40, {1, 2, 3}, {0.1, 0.2, 0.8});
  const Eigen::Vector3f centroid(0.12f, 0.18f, 0.85f);
  const Neighbor same{0, 0, centroid, centroid, 0, {}};
  EXPECT_TRUE(poseFromView(same, view, 0).isApprox(view.T_view_object, 1e-6));
}

TEST(Match, PosesBringTheCentroidsTogetherAndTurnAboutTheViewingAxis) {
  View view;
  view.T_view_object = clouds::motion(40, {1, 2, 3}, {0.1, 0.2, 0.8});
  const Neighbor neighbor{0, 0, {0.12f, 0.18f, 0.85f}, {-0.2f, 0.1f, 1.1f}, 0, {}};
  const Eigen::Vector3d seen = neighbor.cluster_centroid.cast<double>();
  const Eigen::Vector3d trained = neighbor.view_centroid.cast<double>();
  for (const double roll : {0.0, 0.5, 3.0, -2.0}) {
    const Eigen::Isometry3d T = poseFromView(neighbor, view, roll);
    const Eigen::Isometry3d T_camera_view = T * view.T_view_object.inverse();
    EXPECT_TRUE((T_camera_view * trained).isApprox(seen, 1e-6));
    EXPECT_TRUE((T_camera_view.linear() * trained.normalized()).isApprox(seen.normalized(), 1e-6));
    const Eigen::Matrix3d turn = T.linear() * poseFromView(neighbor, view, 0).linear().transpose();
    EXPECT_NEAR(angleOf(turn), std::abs(roll), 1e-6);
    EXPECT_TRUE((turn * seen).isApprox(seen, 1e-6));
  }
}

TEST(Match, ARenderedViewFindsItsOwnObject) {
  const std::vector<Eigen::Vector3d> directions{
      {1, 0.7, 0.8}, {-0.5, 1, 0.6}, {-1, -0.6, 0.9}, {0.4, -1, 0.7}};
  for (const auto& [name, mesh] : shapes())
    for (const auto& direction : directions) {
      Eigen::Isometry3d truth =
          Eigen::Translation3d(0.1, -0.05, 0) * views::lookAt(mesh, direction, 0.9);
      truth = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) * truth;  // the camera rolled
      const Cloud picture = views::imageOf(mesh, truth);
      const auto candidates = matchCluster(views::sampled(picture), observe(picture, std::nullopt),
                                           trainedIndex(), MatchOptions());
      ASSERT_TRUE(candidates) << candidates.reason;
      EXPECT_EQ(candidates->front().name, name) << direction.transpose();
      const auto right = std::any_of(candidates->begin(), candidates->end(), [&](const auto& c) {
        const Eigen::Isometry3d off = truth.inverse() * c.T_camera_object;
        return c.name == name && angleOf(off.linear()) < 25 * DEG;
      });
      EXPECT_TRUE(right) << "no candidate near the true pose of " << name << " seen from "
                         << direction.transpose();
    }
}

TEST(Match, CandidatesComeBestFirstAndDiffer) {
  MatchOptions options;
  options.max_candidates = 5;
  const auto candidates = matched(houseFromTheSide(), trainedIndex(), options);
  ASSERT_TRUE(candidates);
  ASSERT_GE(candidates->size(), 2u);
  EXPECT_LE(candidates->size(), 5u);
  for (std::size_t i = 1; i < candidates->size(); ++i)
    EXPECT_GE((*candidates)[i - 1].promise, (*candidates)[i].promise);
  for (std::size_t i = 0; i < candidates->size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const auto &a = (*candidates)[i], &b = (*candidates)[j];
      EXPECT_FALSE(a.name == b.name && a.T_camera_object.isApprox(b.T_camera_object, 1e-3));
    }
  options.max_candidates = 1;
  const auto best = matched(houseFromTheSide(), trainedIndex(), options);
  ASSERT_EQ(best->size(), 1u);
  EXPECT_EQ(best->front().T_camera_object.matrix(), candidates->front().T_camera_object.matrix());
}

TEST(Match, NoCandidateHasItsReason) {
  MatchOptions options;
  const Surface house = houseFromTheSide();
  EXPECT_EQ(reasonOf(matched(house, ModelIndex(), options)), "the database holds no object");

  Surface tiny = house;
  tiny.points.resize(12);
  tiny.normals.resize(12);
  EXPECT_EQ(reasonOf(matched(tiny, trainedIndex(), options)),
            "the cluster has 12 sampled points, limit 40");
  EXPECT_EQ(reasonOf(matched({}, trainedIndex(), options)),
            "the cluster has 0 sampled points, limit 40");

  options.max_distance = 1;
  EXPECT_NE(reasonOf(matched(house, trainedIndex(), options)).find("no view is nearer than 1 "),
            std::string::npos);

  options = MatchOptions();
  options.max_size_ratio = 0.5;
  const auto large = reasonOf(matched(house, trainedIndex(), options));
  EXPECT_NE(large.find("m across, more than 0.5 times any object"), std::string::npos) << large;
}

TEST(Match, ViewsOfAnotherSizeAreNotCompared) {
  const ModelIndex index(randomModels());
  std::mt19937 random(3);
  const Descriptor query{"vfh", randomHistogram(random), {0, 0, 1}, {}};
  MatchOptions options;
  EXPECT_EQ(nearestViews(query, EXTENT, index, options).size(), 10u);
  EXPECT_TRUE(nearestViews(query, 2 * EXTENT, index, options).empty());
  EXPECT_TRUE(nearestViews(query, 0.2 * EXTENT, index, options).empty());
  options.min_size_ratio = 0.1;
  EXPECT_EQ(nearestViews(query, 0.2 * EXTENT, index, options).size(), 10u);
}

TEST(Match, AxesOfDescriptorsGiveTheWholePose) {
  View view;
  view.T_view_object = clouds::motion(40, {1, 2, 3}, {0.1, 0.2, 0.8});
  const Eigen::Isometry3d T_camera_view = clouds::motion(70, {3, -1, 2}, {0.1, -0.1, 0.2});
  const Eigen::Vector3f trained(0.12f, 0.18f, 0.85f);
  const Eigen::Vector3f seen = T_camera_view.cast<float>() * trained;
  const Neighbor neighbor{0, 0, trained, seen, 0, T_camera_view.linear().cast<float>()};
  EXPECT_TRUE(poseFromView(neighbor, view, 0).isApprox(T_camera_view * view.T_view_object, 1e-5));
}

TEST(Match, TheCameraRollIsFoundFromHistograms) {
  const Mesh mesh = scene::house();
  const Surface trained = views::seen(mesh, views::lookAt(mesh, {1, 0.7, 0.8}, 0.8));
  const auto of_view = computeCameraRoll(trained, Eigen::Vector3f::Zero());
  View view;
  view.T_view_object = views::lookAt(mesh, {1, 0.7, 0.8}, 0.8);
  for (const double roll : {0.0, 0.6, 2.5, -1.4}) {
    const Eigen::Isometry3d truth = Eigen::Translation3d(0.15, -0.1, 0) *
                                    Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()) *
                                    view.T_view_object;
    const auto of_cluster = computeCameraRoll(views::seen(mesh, truth), Eigen::Vector3f::Zero());
    const Neighbor neighbor{0, 0, of_view.centroid, of_cluster.centroid, 0, {}};
    const auto rolls =
        rollsFromHistograms(of_cluster.values.data(), of_view.values.data(), neighbor);
    ASSERT_FALSE(rolls.empty());
    EXPECT_LE(rolls.size(), 6u);
    const bool found = std::any_of(rolls.begin(), rolls.end(), [&](double turn) {
      const auto pose = poseFromView(neighbor, view, turn);
      return angleOf(truth.linear().transpose() * pose.linear()) < 15 * DEG;
    });
    EXPECT_TRUE(found) << roll;
  }
}

TEST(Match, EveryKindFindsARenderedView) {
  const Mesh mesh = scene::house();
  const Eigen::Isometry3d truth = views::lookAt(mesh, {1, 0.7, 0.8}, 0.9);
  const Cloud picture = views::imageOf(mesh, truth);
  for (const char* kinds : {"vfh", "cvfh", "our_cvfh", "esf", "esf our_cvfh"})
    for (const char* roll : {"steps", "histogram"}) {
      MatchOptions options;
      options.kinds = kinds;
      options.roll = roll;
      const auto candidates = matchCluster(views::sampled(picture), observe(picture, std::nullopt),
                                           trainedIndex(), options);
      ASSERT_TRUE(candidates) << candidates.reason;
      EXPECT_EQ(candidates->front().name, "house") << kinds << ", " << roll;
    }
}

TEST(Match, OnlyTheWantedKindsAreCompared) {
  std::vector<ObjectModel> models{views::modelOf("house", scene::house(), icosphereDirections())};
  for (auto& view : models[0].views) view.descriptors.resize(1);  // VFH alone
  const ModelIndex index(models);
  MatchOptions options;
  options.kinds = "vfh";
  EXPECT_TRUE(matched(houseFromTheSide(), index, options));
  options.kinds = "cvfh";
  EXPECT_FALSE(matched(houseFromTheSide(), index, options));
}

TEST(Match, OptionsOutOfRangeAreRefused) {
  MatchOptions options;
  options.kinds = "vfh both";
  EXPECT_EQ(
      clouds::refusalOf([&] { matched({}, ModelIndex(), options); }),
      "match.kinds must be one or several of vfh, cvfh, our_cvfh, esf with spaces between, got "
      "'vfh both'");
}
