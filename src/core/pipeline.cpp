#include "tabletop_perception/pipeline.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <limits>
#include <stdexcept>

#include "tabletop_perception/normals.h"
#include "tabletop_perception/options_yaml.h"
#include "tabletop_perception/propose.h"

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

/// The points of several clusters.
Indices pointsOf(const std::vector<Indices>& clusters, const std::vector<int>& members) {
  Indices points;
  for (const int k : members) points.insert(points.end(), clusters[k].begin(), clusters[k].end());
  std::sort(points.begin(), points.end());
  return points;
}

std::vector<std::uint32_t> labelsOfMembers(const std::vector<int>& members) {
  std::vector<std::uint32_t> labels;
  for (const int k : members) labels.push_back(static_cast<std::uint32_t>(k) + 2);
  return labels;
}

std::vector<int> membersOf(const std::vector<std::uint32_t>& labels) {
  std::vector<int> members;
  for (const auto label : labels) members.push_back(static_cast<int>(label) - 2);
  return members;
}

SceneObject boxedObject(const Cloud& scene, const Indices& points,
                        const std::vector<std::uint32_t>& labels,
                        const std::optional<Table>& table) {
  SceneObject object;
  object.labels = labels;
  object.points = static_cast<int>(points.size());
  std::optional<Eigen::Vector3d> up;
  if (table) up = table->plane.head<3>();
  object.box = boxAround(pointsAt(scene, points), up);
  object.T_camera_object = object.box.T_camera_box;
  return object;
}

/// The table that some points stand on: of those below their centroid the highest, else the main
/// one; none if there is no table.
std::optional<Table> tableBelow(const Cloud& scene, const Indices& points,
                                const std::vector<Table>& tables) {
  if (tables.empty()) return std::nullopt;
  const Eigen::Vector3f middle = centroidOf(pointsAt(scene, points));
  const Table* below = &tables.front();
  double least = std::numeric_limits<double>::infinity();
  for (const auto& table : tables) {
    const double height = heightAbove(table, middle);
    if (height < 0 || height >= least || !isOver(table, middle, 0)) continue;
    below = &table;
    least = height;
  }
  return *below;
}

/// What some clusters are: every candidate refined and verified, the best one kept if it stands up
/// to the limits; else "unknown" with the reason.
SceneObject decideProposal(const Cloud& scene, const std::vector<Indices>& clusters,
                           const Proposal& proposal, const std::vector<Table>& tables,
                           const std::optional<Projection>& projection, const ModelIndex& index,
                           const PipelineOptions& options) {
  const Indices points = pointsOf(clusters, membersOf(proposal.labels));
  const auto table = tableBelow(scene, points, tables);
  SceneObject object = boxedObject(scene, points, proposal.labels, table);
  object.reason = proposal.candidates.reason;
  if (!proposal.candidates) return object;

  const Surface sample = sampleCluster(scene, points, index.descriptorOptions());
  std::vector<Hypothesis> ranked;
  for (const auto& candidate : *proposal.candidates) {
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
  object.explained = best.verification.explained;
  return object;
}

}  // namespace

PipelineOptions readPipelineOptions(const std::string& yaml_file) {
  YAML::Node yaml;
  try {
    yaml = YAML::LoadFile(yaml_file);
  } catch (const YAML::BadFile&) {
    throw std::invalid_argument(yaml_file + ": no such file, or not to be read");
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
  Indices on_tables = table ? table->inliers : Indices{};
  for (const auto& other : other_tables)
    on_tables.insert(on_tables.end(), other.inliers.begin(), other.inliers.end());
  return labelsOf(filtered.size(), on_tables, clusters);
}

std::vector<Table> Segmentation::tables() const {
  std::vector<Table> all = other_tables;
  if (table) all.insert(all.begin(), *table);
  return all;
}

Segmentation segmentScene(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                          const PipelineOptions& options) {
  Segmentation result;
  StopWatch watch(result.times_ms);
  result.filtered = filterCloud(cloud, options.filter);
  watch.lap("filter");

  auto tables = findTables(result.filtered, up, options.table);
  watch.lap("table");
  result.reason = tables.reason;
  if (!tables) return result;
  const Cloud standing = pointsOnTables(result.filtered, *tables, options.table);
  result.table = std::move(tables.value->front());
  result.other_tables.assign(std::make_move_iterator(tables.value->begin() + 1),
                             std::make_move_iterator(tables.value->end()));

  result.clusters = extractClusters(standing, options.cluster);
  watch.lap("cluster");
  result.clusters = splitClusters(standing, result.clusters, options.split);
  watch.lap("split");
  result.clusters = colorCorrected(standing, result.clusters, options.color);
  watch.lap("color");
  if (result.clusters.empty() && result.reason.empty()) result.reason = "nothing stands on it";
  return result;
}

SceneObject unknownObject(const Cloud& scene, const Indices& cluster, std::uint32_t label,
                          const std::optional<Table>& table) {
  return boxedObject(scene, cluster, {label}, table);
}

Surface sampleCluster(const Cloud& scene, const Indices& cluster,
                      const DescriptorOptions& options) {
  return sampleSurface(pointsAt(scene, cluster), options.leaf, options.normal_radius,
                       Eigen::Vector3f::Zero());
}

std::vector<Proposal> proposeObjects(const Cloud& scene, const std::vector<Indices>& clusters,
                                     const ModelIndex& index, const MatchOptions& options) {
  std::vector<Proposal> proposals;
  for (const auto& members : clusterUnions(scene, clusters, options.union_gap)) {
    const Surface sample =
        sampleCluster(scene, pointsOf(clusters, members), index.descriptorOptions());
    proposals.push_back({labelsOfMembers(members), matchCluster(sample, index, options)});
  }
  return proposals;
}

std::vector<SceneObject> decideObjects(const Cloud& scene, const std::vector<Indices>& clusters,
                                       const std::vector<Proposal>& proposals,
                                       const std::vector<Table>& tables, const ModelIndex& index,
                                       const PipelineOptions& options) {
  const auto projection = fitProjection(scene).value;
  const auto main_table = tables.empty() ? std::nullopt : std::optional(tables.front());
  std::vector<SceneObject> known, objects;
  std::vector<SceneObject> alone(clusters.size());  // each cluster, should it remain unknown
  for (const auto& proposal : proposals) {
    SceneObject object =
        decideProposal(scene, clusters, proposal, tables, projection, index, options);
    if (proposal.labels.size() == 1) {
      alone.at(proposal.labels[0] - 2) =
          unknownObject(scene, clusters.at(proposal.labels[0] - 2), proposal.labels[0], main_table);
      alone[proposal.labels[0] - 2].reason = object.reason;
    }
    if (object.name != "unknown") known.push_back(std::move(object));
  }
  std::stable_sort(known.begin(), known.end(), [](const SceneObject& a, const SceneObject& b) {
    return a.score * a.explained * a.points > b.score * b.explained * b.points;
  });

  std::vector<bool> taken(clusters.size(), false);
  const auto isTaken = [&](std::uint32_t label) -> bool { return taken[label - 2]; };
  for (auto& object : known) {
    if (std::any_of(object.labels.begin(), object.labels.end(), isTaken)) continue;
    for (const auto label : object.labels) taken[label - 2] = true;
    objects.push_back(std::move(object));
  }
  for (std::size_t k = 0; k < clusters.size(); ++k)
    if (!taken[k] && !alone[k].labels.empty()) objects.push_back(std::move(alone[k]));
  std::stable_sort(objects.begin(), objects.end(), [](const SceneObject& a, const SceneObject& b) {
    return a.labels.front() < b.labels.front();
  });
  return objects;
}

Recognition recognizeScene(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                           const ModelIndex& index, const PipelineOptions& options) {
  Recognition result;
  result.segmentation = segmentScene(cloud, up, options);
  result.times_ms = result.segmentation.times_ms;
  StopWatch watch(result.times_ms);
  const Cloud& scene = result.segmentation.filtered;
  const auto& clusters = result.segmentation.clusters;
  const auto proposals = proposeObjects(scene, clusters, index, options.match);
  watch.lap("match");
  result.objects =
      decideObjects(scene, clusters, proposals, result.segmentation.tables(), index, options);
  watch.lap("refine");
  return result;
}

}  // namespace tabletop_perception
