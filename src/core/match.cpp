#include "tabletop_perception/match.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace tabletop_perception {
namespace {

constexpr int PROBES = 150;             // points of a cluster that judge a roll
constexpr float MAX_MISFIT = 0.03f;     // farther points all count the same [m]
constexpr double SAME_ANGLE = 0.26;     // candidates nearer than this [rad]
constexpr double SAME_DISTANCE = 0.02;  // and this are one [m]

/// A lower bound of the largest distance of two points, exact for most shapes.
double extentOf(const std::vector<Eigen::Vector3f>& points) {
  const auto farthestFrom = [&](const Eigen::Vector3f& from) {
    return *std::max_element(points.begin(), points.end(), [&](const auto& a, const auto& b) {
      return (a - from).squaredNorm() < (b - from).squaredNorm();
    });
  };
  const Eigen::Vector3f end = farthestFrom(centroidOf(points));
  return (farthestFrom(end) - end).norm();
}

std::vector<Eigen::Vector3f> probesOf(const Surface& cluster) {
  const std::size_t step = std::max<std::size_t>(1, cluster.size() / PROBES);
  std::vector<Eigen::Vector3f> probes;
  for (std::size_t i = 0; i < cluster.size(); i += step) probes.push_back(cluster.points[i]);
  return probes;
}

/// RMS distance of the probes from the model, far ones cut off [m].
double misfitOf(const std::vector<Eigen::Vector3f>& probes, const ObjectModel& model,
                const NearestGrid& grid, const Eigen::Isometry3d& T_camera_object) {
  const Eigen::Isometry3f T_object_camera = T_camera_object.inverse().cast<float>();
  double sum = 0;
  for (const auto& probe : probes) {
    const Eigen::Vector3f p = T_object_camera * probe;
    const int nearest = grid.nearest(p);
    const float distance =
        nearest < 0 ? MAX_MISFIT : std::min(MAX_MISFIT, (model.surface.points[nearest] - p).norm());
    sum += distance * distance;
  }
  return std::sqrt(sum / static_cast<double>(probes.size()));
}

bool samePose(const Candidate& a, const Candidate& b) {
  const Eigen::Isometry3d motion = a.T_camera_object.inverse() * b.T_camera_object;
  return a.name == b.name && motion.translation().norm() < SAME_DISTANCE &&
         angleOf(motion.linear()) < SAME_ANGLE;
}

bool wanted(const std::string& kind, const MatchOptions& options) {
  return options.kinds == "both" || options.kinds == kind;
}

std::string format(const char* text, double value, double limit) {
  char line[160];
  std::snprintf(line, sizeof line, text, value, limit);
  return line;
}

}  // namespace

double histogramDistance(const float* a, const float* b, int size, const std::string& metric) {
  double sum = 0;
  if (metric == "l1") {
    for (int i = 0; i < size; ++i) sum += std::abs(a[i] - b[i]);
    return sum;
  }
  if (metric == "l2") {
    for (int i = 0; i < size; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return std::sqrt(sum);
  }
  checkOption("match.metric", metric, Choices{{"l1", "l2", "chi_square"}});
  for (int i = 0; i < size; ++i)
    if (a[i] + b[i] > 0) sum += (a[i] - b[i]) * (a[i] - b[i]) / (a[i] + b[i]);
  return sum;
}

std::vector<Neighbor> nearestViews(const Descriptor& descriptor, const ModelIndex& index,
                                   const MatchOptions& options) {
  const auto& vectors = index.vectors(descriptor.kind);
  if (vectors.dimension != static_cast<int>(descriptor.values.size())) return {};
  std::vector<Neighbor> neighbors;
  for (std::size_t i = 0; i < vectors.entries.size(); ++i) {
    const auto& entry = vectors.entries[i];
    const float* row = vectors.values.data() + i * vectors.dimension;
    neighbors.push_back(
        {entry.model, entry.view, entry.centroid, descriptor.centroid,
         histogramDistance(descriptor.values.data(), row, vectors.dimension, options.metric)});
  }
  const auto nearer = [](const Neighbor& a, const Neighbor& b) { return a.distance < b.distance; };
  std::stable_sort(neighbors.begin(), neighbors.end(), nearer);
  if (neighbors.size() > static_cast<std::size_t>(options.neighbors))
    neighbors.resize(options.neighbors);
  while (!neighbors.empty() && neighbors.back().distance > options.max_distance)
    neighbors.pop_back();
  return neighbors;
}

Eigen::Isometry3d poseFromView(const Neighbor& neighbor, const View& view, double roll) {
  const Eigen::Vector3d seen = neighbor.cluster_centroid.cast<double>();
  const Eigen::Vector3d trained = neighbor.view_centroid.cast<double>();
  const Eigen::Matrix3d R = Eigen::AngleAxisd(roll, seen.normalized()).toRotationMatrix() *
                            rotationBetween(trained.normalized(), seen.normalized());
  Eigen::Isometry3d T_camera_view = Eigen::Isometry3d::Identity();
  T_camera_view.linear() = R;
  T_camera_view.translation() = seen - R * trained;
  return T_camera_view * view.T_view_object;
}

Found<std::vector<Candidate>> matchCluster(const Surface& cluster, const ModelIndex& index,
                                           const MatchOptions& options) {
  using Result = Found<std::vector<Candidate>>;
  checkOptions("match", options);
  if (index.empty()) return Result::none("the database holds no object");
  const auto descriptors =
      describeSurface(cluster, Eigen::Vector3f::Zero(), index.descriptorOptions());
  if (descriptors.empty())
    return Result::none(format("the cluster has %.0f sampled points, limit %.0f",
                               static_cast<double>(cluster.size()),
                               index.descriptorOptions().min_points));

  const double extent = extentOf(cluster.points);
  const auto probes = probesOf(cluster);
  std::vector<Candidate> all;
  bool any_near = false;
  for (const auto& descriptor : descriptors) {
    if (!wanted(descriptor.kind, options)) continue;
    for (const auto& neighbor : nearestViews(descriptor, index, options)) {
      any_near = true;
      const ObjectModel& model = index.models()[neighbor.model];
      if (extent > options.max_size_ratio * model.diameter) continue;
      for (int roll = 0; roll < options.rolls; ++roll) {
        Candidate candidate;
        candidate.name = model.name;
        candidate.distance = neighbor.distance;
        candidate.T_camera_object =
            poseFromView(neighbor, model.views[neighbor.view], 2 * M_PI * roll / options.rolls);
        candidate.misfit =
            misfitOf(probes, model, index.grid(neighbor.model), candidate.T_camera_object);
        all.push_back(std::move(candidate));
      }
    }
  }
  if (!any_near)
    return Result::none(
        format("no view is nearer than %.0f in the descriptor's metric (%.0f compared)",
               options.max_distance, static_cast<double>(descriptors.size())));
  if (all.empty())
    return Result::none(
        format("the cluster is %.2f m across, more than %.1f times any object it looks like",
               extent, options.max_size_ratio));

  std::stable_sort(all.begin(), all.end(),
                   [](const Candidate& a, const Candidate& b) { return a.misfit < b.misfit; });
  std::vector<Candidate> best;
  for (auto& candidate : all) {
    if (static_cast<int>(best.size()) == options.max_candidates) break;
    const bool known = std::any_of(best.begin(), best.end(), [&](const Candidate& other) {
      return samePose(other, candidate);
    });
    if (!known) best.push_back(std::move(candidate));
  }
  return best;
}

}  // namespace tabletop_perception
