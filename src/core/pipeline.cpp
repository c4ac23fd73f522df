#include "tabletop_perception/pipeline.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <stdexcept>

#include "tabletop_perception/normals.h"
#include "tabletop_perception/options_yaml.h"

namespace tabletop_perception {
namespace {

/// Measures stages one after the other.
class StopWatch {
 public:
  explicit StopWatch(std::map<std::string, double>& times_ms) : times_ms_(times_ms) {}

  /// Books the time since the last lap under `stage`, on top of what is there.
  void lap(const std::string& stage) {
    const auto now = Clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
    times_ms_[stage] += ms;
    times_ms_["total"] += ms;
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::map<std::string, double>& times_ms_;
  Clock::time_point last_ = Clock::now();
};

std::vector<Eigen::Vector3f> pointsAt(const Cloud& cloud, const Indices& indices) {
  std::vector<Eigen::Vector3f> points;
  points.reserve(indices.size());
  for (const int i : indices) points.push_back(cloud.point(i));
  return points;
}

std::optional<Projection> projectionOf(const Cloud& cloud) { return fitProjection(cloud).value; }

/// A candidate after ICP, and what the camera says about it.
struct Hypothesis {
  const ObjectModel* model;
  Eigen::Isometry3d T_camera_object;
  Verification verification;
};

/// Accepted hypotheses before refused ones, each by score.
bool better(const Hypothesis& a, const Hypothesis& b) {
  const bool a_stands = a.verification.reason.empty(), b_stands = b.verification.reason.empty();
  return a_stands != b_stands ? a_stands : a.verification.score > b.verification.score;
}

std::string marginRefusal(const std::vector<Hypothesis>& ranked, const VerifyOptions& options) {
  const Hypothesis& best = ranked.front();
  for (const auto& other : ranked) {
    if (other.model == best.model) continue;
    const double margin = best.verification.score - other.verification.score;
    if (margin >= options.min_margin) return "";
    char text[200];
    std::snprintf(text, sizeof text, "margin %.2f over %s, limit %.2f", margin,
                  other.model->name.c_str(), options.min_margin);
    return text;
  }
  return "";
}

}  // namespace

PipelineOptions readPipelineOptions(const std::string& yaml_file) {
  YAML::Node yaml;
  try {
    yaml = YAML::LoadFile(yaml_file);
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument(yaml_file + ": " + error.what());
  }
  PipelineOptions options;
  std::vector<std::string> sections;
  try {
    options.visitStages([&](const std::string& section, auto& stage) {
      sections.push_back(section);
      if (yaml.IsMap()) readYaml(section, yaml[section], stage);
    });
    checkYamlKeys("options", yaml, sections);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(yaml_file + ": " + error.what());
  }
  return options;
}

std::vector<std::uint32_t> Segmentation::labels() const {
  return labelsOf(filtered.size(), table ? table->inliers : Indices{}, clusters);
}

Segmentation segmentScene(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                          const PipelineOptions& options) {
  Segmentation result;
  StopWatch watch(result.times_ms);
  result.filtered = filterCloud(cloud, options.filter);
  watch.lap("filter");

  auto table = findTable(result.filtered, up, options.table);
  watch.lap("table");
  result.reason = table.reason;
  if (!table) return result;
  result.table = std::move(table.value);

  const Cloud standing = pointsOnTable(result.filtered, *result.table, options.table);
  result.clusters = extractClusters(standing, options.cluster);
  watch.lap("cluster");
  result.clusters = splitClusters(standing, result.clusters, options.split);
  watch.lap("split");
  if (result.clusters.empty() && result.reason.empty()) result.reason = "nothing stands on it";
  return result;
}

SceneObject unknownObject(const Cloud& scene, const Indices& cluster, std::uint32_t label,
                          const std::optional<Table>& table) {
  SceneObject object;
  object.labels = {label};
  object.points = static_cast<int>(cluster.size());
  std::optional<Eigen::Vector3d> up;
  if (table) up = table->plane.head<3>();
  object.box = boxAround(pointsAt(scene, cluster), up);
  object.T_camera_object = object.box.T_camera_box;
  return object;
}

Surface sampleCluster(const Cloud& scene, const Indices& cluster,
                      const DescriptorOptions& options) {
  return sampleSurface(pointsAt(scene, cluster), options.leaf, options.normal_radius,
                       Eigen::Vector3f::Zero());
}

SceneObject decideCluster(const Cloud& scene, const Indices& cluster, std::uint32_t label,
                          const Found<std::vector<Candidate>>& candidates,
                          const std::optional<Table>& table,
                          const std::optional<Projection>& projection, const ModelIndex& index,
                          const PipelineOptions& options) {
  SceneObject object = unknownObject(scene, cluster, label, table);
  object.reason = candidates.reason;
  if (!candidates) return object;

  const Surface sample = sampleCluster(scene, cluster, index.descriptorOptions());
  std::vector<Hypothesis> ranked;
  for (const auto& candidate : *candidates) {
    const int m = index.find(candidate.name);
    if (m < 0) continue;  // taken out of the database meanwhile
    const ObjectModel& model = index.models()[m];
    const auto alignment =
        refinePose(sample, model.surface, index.grid(m), candidate.T_camera_object, options.refine);
    if (object.reason.empty()) object.reason = alignment.reason;
    if (!alignment) continue;
    ranked.push_back({&model, alignment->T_camera_object,
                      verifyPose(model, index.grid(m), alignment->T_camera_object, sample, scene,
                                 projection, table, options.verify)});
  }
  if (ranked.empty()) {
    if (object.reason.empty()) object.reason = "what it looked like is no longer in the database";
    return object;
  }

  std::stable_sort(ranked.begin(), ranked.end(), better);
  const Hypothesis& best = ranked.front();
  object.reason = best.verification.reason.empty()
                      ? marginRefusal(ranked, options.verify)
                      : best.model->name + ": " + best.verification.reason;
  if (!object.reason.empty()) return object;
  object.name = best.model->name;
  object.score = best.verification.score;
  object.T_camera_object = best.T_camera_object;
  object.fitness = best.verification.fitness;
  object.visible = best.verification.visible;
  return object;
}

SceneObject recognizeCluster(const Cloud& scene, const Indices& cluster, std::uint32_t label,
                             const std::optional<Table>& table,
                             const std::optional<Projection>& projection, const ModelIndex& index,
                             const PipelineOptions& options) {
  const Surface sample = sampleCluster(scene, cluster, index.descriptorOptions());
  return decideCluster(scene, cluster, label, matchCluster(sample, index, options.match), table,
                       projection, index, options);
}

Recognition recognizeScene(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                           const ModelIndex& index, const PipelineOptions& options) {
  Recognition result;
  result.segmentation = segmentScene(cloud, up, options);
  result.times_ms = result.segmentation.times_ms;
  StopWatch watch(result.times_ms);
  const Cloud& scene = result.segmentation.filtered;
  const auto projection = projectionOf(scene);

  for (std::size_t k = 0; k < result.segmentation.clusters.size(); ++k) {
    const Indices& cluster = result.segmentation.clusters[k];
    const Surface sample = sampleCluster(scene, cluster, index.descriptorOptions());
    const auto candidates = matchCluster(sample, index, options.match);
    watch.lap("match");
    result.objects.push_back(decideCluster(scene, cluster, static_cast<std::uint32_t>(k) + 2,
                                           candidates, result.segmentation.table, projection, index,
                                           options));
    watch.lap("refine");
  }
  return result;
}

}  // namespace tabletop_perception
