#include "tabletop_perception/pipeline.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <iterator>
#include <stdexcept>

#include "stop_watch.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/options_yaml.h"
#include "tabletop_perception/propose.h"

namespace tabletop_perception {
namespace {

/// The samples of several clusters.
Surface sampleOf(const std::vector<Surface>& samples, const std::vector<int>& members) {
  Surface all;
  for (const int k : members) {
    const Surface& some = samples[k];
    all.points.insert(all.points.end(), some.points.begin(), some.points.end());
    all.normals.insert(all.normals.end(), some.normals.begin(), some.normals.end());
  }
  return all;
}

std::vector<std::uint32_t> labelsOfMembers(const std::vector<int>& members) {
  std::vector<std::uint32_t> labels;
  for (const int k : members) labels.push_back(static_cast<std::uint32_t>(k) + 2);
  return labels;
}

/// Calls work(i) once for each i below `count`, on so many threads. What one throws, this throws.
template <typename Work>
void forEach(std::size_t count, int threads, Work work) {
  std::atomic<std::size_t> next{0};
  const auto run = [&] {
    for (std::size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::future<void>> others;  // wait for their ends when they are destroyed
  for (int t = 1; t < threads; ++t) others.push_back(std::async(std::launch::async, run));
  run();
  for (auto& other : others) other.get();
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
  const Indices standing = indicesOnTables(result.filtered, *tables, options.table);
  result.table = std::move(tables.value->front());
  result.other_tables.assign(std::make_move_iterator(tables.value->begin() + 1),
                             std::make_move_iterator(tables.value->end()));

  result.clusters = extractClusters(result.filtered, standing, options.cluster);
  watch.lap("cluster");
  result.clusters = splitClusters(result.filtered, result.clusters, options.split);
  watch.lap("split");
  result.clusters = colorCorrected(result.filtered, result.clusters, options.color);
  watch.lap("color");
  if (result.clusters.empty() && result.reason.empty()) result.reason = "nothing stands on it";
  return result;
}

std::vector<Proposal> proposeObjects(const Cloud& scene, const std::vector<Indices>& clusters,
                                     const std::vector<Table>& tables, const ModelIndex& index,
                                     const MatchOptions& options) {
  ProposalMemory none;
  return proposeObjects(scene, clusters, tables, index, options, 0, none);
}

std::vector<Proposal> proposeObjects(const Cloud& scene, const std::vector<Indices>& clusters,
                                     const std::vector<Table>& tables, const ModelIndex& index,
                                     const MatchOptions& options, double stamp,
                                     ProposalMemory& memory) {
  checkOptions("match", options);
  const auto unions = clusterUnions(scene, clusters, options.union_gap);
  std::vector<Proposal> proposals;
  std::vector<ClusterShape> shapes;
  std::vector<bool> recalled;
  std::vector<std::size_t> changed;  // the others
  for (std::size_t k = 0; k < unions.size(); ++k) {
    shapes.push_back(shapeOf(scene, clusters, unions[k]));
    const auto* candidates = memory.recall(stamp, shapes.back(), options.keep);
    recalled.push_back(candidates != nullptr);
    if (!candidates) changed.push_back(k);
    proposals.push_back({labelsOfMembers(unions[k]),
                         candidates ? *candidates : Found<std::vector<Candidate>>::none("")});
  }
  if (!changed.empty()) {
    std::vector<int> sampled;  // clusters that have changed, alone or in a union
    for (const std::size_t k : changed)
      sampled.insert(sampled.end(), unions[k].begin(), unions[k].end());
    std::sort(sampled.begin(), sampled.end());
    sampled.erase(std::unique(sampled.begin(), sampled.end()), sampled.end());
    std::vector<Surface> samples(clusters.size());
    forEach(sampled.size(), options.threads, [&](std::size_t i) {
      const int k = sampled[i];
      samples[k] = sampleCluster(scene, clusters[k], index.descriptorOptions());
    });
    const Observations observations(scene, tables);
    forEach(changed.size(), options.threads, [&](std::size_t i) {
      const std::size_t k = changed[i];
      const Surface sample = sampleOf(samples, unions[k]);
      const Observation& observation = observations.about(centroidOf(sample.points));
      proposals[k].candidates = matchCluster(sample, observation, index, options);
    });
  }
  memory.remember(stamp, shapes, proposals, recalled);
  return proposals;
}

Recognition recognizeScene(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                           const ModelIndex& index, const PipelineOptions& options) {
  Recognition result;
  result.segmentation = segmentScene(cloud, up, options);
  result.times_ms = result.segmentation.times_ms;
  StopWatch watch(result.times_ms);
  const Cloud& scene = result.segmentation.filtered;
  const auto& clusters = result.segmentation.clusters;
  const auto tables = result.segmentation.tables();
  const auto proposals = proposeObjects(scene, clusters, tables, index, options.match);
  watch.lap("match");
  result.objects = decideObjects(scene, clusters, proposals, tables, index, options.match,
                                 options.refine, options.verify);
  watch.lap("refine");
  return result;
}

}  // namespace tabletop_perception
