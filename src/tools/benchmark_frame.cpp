#include "benchmark_frame.h"

#include <algorithm>
#include <utility>

#include "stock_pcl.h"
#include "stock_recognition.h"
#include "tabletop_perception/match.h"
#include "tabletop_perception/refine.h"

namespace tabletop_perception::tools {
namespace {

constexpr int OBJECTS = 5;         // of a frame
constexpr int HYPOTHESES = 5;      // of each, where they are verified
constexpr int ITERATIONS = 20;     // of ICP
constexpr double DISTANCE = 0.02;  // farthest correspondence of it [m]
const std::string VFH = "vfh";

/// What the front end leaves to recognition.
struct Standing {
  Cloud scene;
  std::vector<Table> tables;
  std::vector<Indices> clusters;  ///< the largest ones that are large enough to be described
};

Standing ourFrontEnd(const Frame& frame, const PipelineOptions& options,
                     const DescriptorOptions& sampling) {
  Standing standing;
  standing.scene = filterCloud(frame.message, options.filter);
  auto tables = findTables(standing.scene, frame.up, options.table);
  if (!tables) return standing;
  standing.tables = std::move(*tables);
  const auto clusters = extractClusters(
      standing.scene, indicesOnTables(standing.scene, standing.tables, options.table),
      options.cluster);
  for (auto& cluster : splitClusters(standing.scene, clusters, options.split)) {
    if (standing.clusters.size() == OBJECTS) break;
    if (static_cast<int>(cluster.size()) >= sampling.min_points)
      standing.clusters.push_back(std::move(cluster));
  }
  return standing;
}

/// Normals, VFH, the nearest view, and ICP from the pose that it suggests.
Found<Alignment> alignOurs(const Cloud& scene, const Indices& cluster, const ModelIndex& models) {
  MatchOptions match;
  match.neighbors = 1;
  match.max_distance = 1e6;
  match.min_size_ratio = 0;
  match.max_size_ratio = 100;
  RefineOptions refine;
  refine.max_iterations = ITERATIONS;
  refine.start_distance = refine.max_distance = DISTANCE;
  refine.trim = 1;
  refine.min_rotation = refine.min_translation = refine.min_overlap = 0;

  const Surface sample = sampleCluster(scene, cluster, models.descriptorOptions());
  const Descriptor descriptor = computeVfh(sample, Eigen::Vector3f::Zero());
  const auto nearest = nearestViews(descriptor, extentOf(sample.points), models, match).front();
  const View& view = models.models()[nearest.model].views[nearest.view];
  return refinePose(sample, models.grid(nearest.model), poseFromView(nearest, view, 0), refine);
}

/// Stock PCL's way to the same.
class StockChain {
 public:
  StockChain(const ModelIndex& models)
      : models_(models), search_(models.vectors(VFH).values, models.vectors(VFH).dimension) {
    for (const auto& model : models.models()) targets_.emplace_back(model.surface);
  }

  stock::Registration align(const stock::Points::ConstPtr& voxels) const {
    const auto points = stock::withNormals(voxels, models_.descriptorOptions().normal_radius);
    const auto signature = stock::vfh(points);
    const int row = search_.nearest({signature.begin(), signature.end()}, 1).front();
    const auto& entry = models_.vectors(VFH).entries[row];
    const Neighbor neighbor{entry.model, entry.view, entry.centroid, stock::centroidOf(points),
                            0,           {}};
    const View& view = models_.models()[entry.model].views[entry.view];
    const Eigen::Isometry3d start = poseFromView(neighbor, view, 0).inverse();
    return targets_[entry.model].alignToPoints(points, start.cast<float>(), DISTANCE, ITERATIONS);
  }

 private:
  const ModelIndex& models_;
  stock::LinearSearch search_;
  std::vector<stock::RegistrationTarget> targets_;
};

/// The pipeline with few hypotheses: those of the views nearest by VFH, as shipped otherwise.
MatchOptions fewHypotheses(MatchOptions options) {
  options.kinds = VFH;
  options.neighbors = HYPOTHESES;
  options.max_candidates = HYPOTHESES;
  options.stands = options.parts = false;
  options.threads = 1;
  return options;
}

}  // namespace

std::vector<StageTiming> benchmarkFrame(const Frame& frame, const PipelineOptions& options,
                                        const ModelIndex& models, int runs) {
  const auto find = [&] { return ourFrontEnd(frame, options, models.descriptorOptions()); };
  const Standing found = find();
  if (found.clusters.empty() || models.vectors(VFH).entries.empty()) return {};
  std::vector<stock::Points::ConstPtr> voxels;
  for (const auto& cluster : found.clusters)
    voxels.push_back(
        stock::packagedPcl().voxelGrid(stock::pointsOf(keepPoints(found.scene, cluster))));

  const StockChain chain(models);
  const auto stock = [&] {
    frame.stock_front_end();
    for (const auto& some : voxels) discarding([&] { return chain.align(some); })();
  };
  const auto ours = [&] {
    const Standing standing = find();
    for (const auto& cluster : standing.clusters)
      discarding([&] { return alignOurs(standing.scene, cluster, models); })();
  };
  const MatchOptions match = fewHypotheses(options.match);
  const auto ours_verified = [&] {
    const Standing s = find();
    const auto proposals = proposeObjects(s.scene, s.clusters, s.tables, models, match);
    return decideObjects(s.scene, s.clusters, proposals, s.tables, models, match, options.refine,
                         options.verify);
  };
  const std::string name = "chain for " + std::to_string(found.clusters.size()) + " clusters";
  std::vector<StageTiming> stages;
  stages.push_back(timeInTurn("frame", name, runs, ours, stock));
  stages.push_back(timeInTurn("frame_verified", name, runs, discarding(ours_verified), stock));
  return stages;
}

}  // namespace tabletop_perception::tools
