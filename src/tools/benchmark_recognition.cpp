#include "benchmark_recognition.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "stock_recognition.h"
#include "tabletop_perception/match.h"
#include "tabletop_perception/random.h"
#include "tabletop_perception/refine.h"

namespace tabletop_perception::tools {
namespace {

constexpr int ITERATIONS = 20;     // of ICP
constexpr double DISTANCE = 0.02;  // farthest correspondence of it [m]
constexpr int VECTORS = 10000;     // that are searched
constexpr int NEIGHBORS = 10;      // that are wanted of them
constexpr double JITTER = 0.1;     // of their bins, share
const std::string VFH = "vfh";

/// Sampled clusters, the largest first, as far as they are large enough to be described.
std::vector<Surface> samplesOf(const Segmentation& segmentation, const DescriptorOptions& options) {
  std::vector<Surface> samples;
  for (const auto& cluster : segmentation.clusters) {
    Surface sample = sampleCluster(segmentation.filtered, cluster, options);
    if (static_cast<int>(sample.size()) >= options.min_points) samples.push_back(std::move(sample));
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Surface& a, const Surface& b) { return a.size() > b.size(); });
  return samples;
}

StageTiming timeVfh(const std::vector<Surface>& samples, int runs) {
  std::vector<stock::Oriented::ConstPtr> points;
  for (const auto& sample : samples) points.push_back(stock::orientedPoints(sample));
  return timeInTurn(
      VFH, "VFHEstimation", runs,
      [&] {
        for (const auto& sample : samples)
          discarding([&] { return computeVfh(sample, Eigen::Vector3f::Zero()); })();
      },
      [&] {
        for (const auto& some : points) discarding([&] { return stock::vfh(some); })();
      });
}

StageTiming timeIcp(const Surface& sample, const Candidate& candidate, const ModelIndex& models,
                    int runs) {
  const int model = models.find(candidate.name);
  RefineOptions options;
  options.max_iterations = ITERATIONS;
  options.start_distance = options.max_distance = DISTANCE;
  options.trim = 1;
  options.min_rotation = options.min_translation = options.min_overlap = 0;
  const auto source = stock::orientedPoints(sample);
  const stock::RegistrationTarget target(models.models()[model].surface);
  const Eigen::Isometry3f start = candidate.T_camera_object.inverse().cast<float>();
  return timeInTurn("icp", "IterativeClosestPointWithNormals", runs, discarding([&] {
                      return refinePose(sample, models.grid(model), candidate.T_camera_object,
                                        options);
                    }),
                    discarding([&] { return target.align(source, start, DISTANCE, ITERATIONS); }));
}

StageTiming timeSearch(const Surface& sample, const ModelIndex& models, int runs) {
  const ModelIndex many = manyVectors(models, VECTORS);
  const auto& vectors = many.vectors(VFH);
  const stock::LinearSearch search(vectors.values, vectors.dimension);
  const Descriptor query = computeVfh(sample, Eigen::Vector3f::Zero());
  const double extent = vectors.entries.front().extent;  // none is left out for its size
  MatchOptions options;
  options.neighbors = NEIGHBORS;
  options.max_distance = 1e6;
  return timeInTurn("search", "flann::LinearIndex", runs,
                    discarding([&] { return nearestViews(query, extent, many, options); }),
                    discarding([&] { return search.nearest(query.values, NEIGHBORS); }));
}

}  // namespace

ModelIndex manyVectors(const ModelIndex& models, int rows) {
  const auto& known = models.vectors(VFH);
  if (known.entries.empty()) throw std::invalid_argument("the database holds no VFH vector");
  ObjectModel model = models.models().front();
  model.views.clear();
  const Surface least{{Eigen::Vector3f::Zero(), Eigen::Vector3f::UnitX()},
                      {Eigen::Vector3f::UnitX(), Eigen::Vector3f::UnitX()}};  // all of one size
  Random random(1);
  for (int row = 0; row < rows; ++row) {
    const auto from = known.values.begin() +
                      static_cast<std::ptrdiff_t>(row % known.entries.size()) * known.dimension;
    Descriptor descriptor{VFH, {from, from + known.dimension}, Eigen::Vector3f::UnitZ(), {}};
    for (float& value : descriptor.values)
      value *= static_cast<float>(random.uniform(1 - JITTER, 1 + JITTER));
    View view;
    view.surface = least;
    view.descriptors.push_back(std::move(descriptor));
    model.views.push_back(std::move(view));
  }
  return ModelIndex({std::move(model)});
}

std::vector<StageTiming> benchmarkRecognition(const Segmentation& segmentation,
                                              const ModelIndex& models, int runs) {
  const auto samples = samplesOf(segmentation, models.descriptorOptions());
  if (models.empty() || samples.empty()) return {};
  const Surface& largest = samples.front();
  const auto tables = segmentation.tables();
  const Observations observations(segmentation.filtered, tables);
  const auto candidates =
      matchCluster(largest, observations.about(centroidOf(largest.points)), models, MatchOptions());
  std::vector<StageTiming> stages;
  stages.push_back(timeVfh(samples, runs));
  if (candidates) stages.push_back(timeIcp(largest, candidates->front(), models, runs));
  if (!models.vectors(VFH).entries.empty()) stages.push_back(timeSearch(largest, models, runs));
  return stages;
}

}  // namespace tabletop_perception::tools
