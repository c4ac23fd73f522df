#include "tabletop_perception/bop_metrics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>

namespace tabletop_perception {
namespace {

constexpr int THRESHOLDS = 10;               // of each kind, evenly spaced
constexpr float VISIBILITY_MARGIN = 0.015f;  // of a model behind the scene's surface [m]
constexpr double REFERENCE_WIDTH = 640;      // [pixels]

double projectionDistance(const std::vector<Eigen::Vector3f>& vertices,
                          const Projection& projection, const Eigen::Isometry3d& a,
                          const Eigen::Isometry3d& b) {
  double largest = 0;
  for (const auto& vertex : vertices) {
    const Eigen::Vector3d v = vertex.cast<double>();
    const double distance = (projection.pixel(a * v) - projection.pixel(b * v)).squaredNorm();
    largest = std::max(largest, distance);
  }
  return std::sqrt(largest);
}

/// Distances from the camera per pixel [m], NaN where nothing is.
std::vector<float> distancesOf(const Cloud& cloud) {
  std::vector<float> distances(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) distances[i] = cloud.point(i).norm();
  return distances;
}

std::array<double, 10> surfaceDiscrepancies(const std::vector<float>& scene,
                                            const std::vector<float>& truth,
                                            const std::vector<float>& estimate, double diameter) {
  std::array<std::size_t, THRESHOLDS> wrong{};
  std::size_t either = 0;
  const auto visible = [&](float distance, float in_scene) {
    // Where the sensor has no depth, nothing is known to hide the model.
    return !std::isnan(distance) && !(distance - in_scene > VISIBILITY_MARGIN);
  };
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const bool truth_seen = visible(truth[i], scene[i]);
    // What hides the true object's place in the scene is the object itself.
    const bool estimate_seen =
        visible(estimate[i], scene[i]) || (truth_seen && !std::isnan(estimate[i]));
    if (!truth_seen && !estimate_seen) continue;
    ++either;
    const double apart = truth_seen && estimate_seen ? std::abs(truth[i] - estimate[i])
                                                     : std::numeric_limits<double>::infinity();
    for (int t = 0; t < THRESHOLDS; ++t) wrong[t] += apart >= 0.05 * (t + 1) * diameter;
  }
  std::array<double, 10> discrepancies;
  for (int t = 0; t < THRESHOLDS; ++t)
    discrepancies[t] = either == 0 ? 1 : static_cast<double>(wrong[t]) / either;
  return discrepancies;
}

/// Share of the thresholds `step`, 2 step, ... that a value stays below.
double shareBelow(double value, double step) {
  int below = 0;
  for (int t = 1; t <= THRESHOLDS; ++t) below += value < t * step;
  return static_cast<double>(below) / THRESHOLDS;
}

}  // namespace

BopError measureBop(const ReferenceModel& model, const MeshRenderer& renderer, const Cloud& scene,
                    const Projection& projection, const Eigen::Isometry3d& T_camera_truth,
                    const Eigen::Isometry3d& T_camera_estimate) {
  if (scene.width != projection.width || scene.height != projection.height)
    throw std::invalid_argument("the scene has not the size of the camera's picture");
  BopError error;
  error.mssd = measurePose(model, T_camera_truth, T_camera_estimate).mssd;
  error.mspd = std::numeric_limits<double>::infinity();
  for (const auto& symmetry : model.symmetries)
    error.mspd =
        std::min(error.mspd, projectionDistance(model.vertices.points(), projection,
                                                T_camera_truth * symmetry, T_camera_estimate));
  error.mspd *= REFERENCE_WIDTH / projection.width;
  error.vsd = surfaceDiscrepancies(
      distancesOf(scene), distancesOf(renderer.render(T_camera_truth, projection)),
      distancesOf(renderer.render(T_camera_estimate, projection)), model.diameter);
  return error;
}

BopRecall bopRecall(const BopError& error, double diameter) {
  BopRecall recall;
  for (const double vsd : error.vsd) recall.vsd += shareBelow(vsd, 0.05) / THRESHOLDS;
  recall.mssd = shareBelow(error.mssd, 0.05 * diameter);
  recall.mspd = shareBelow(error.mspd, 5);
  return recall;
}

std::optional<BopRecall> meanRecall(const std::vector<std::optional<BopRecall>>& objects) {
  if (objects.empty()) return std::nullopt;
  const double count = static_cast<double>(objects.size());
  BopRecall mean;
  for (const auto& recall : objects) {
    if (!recall) continue;
    mean.vsd += recall->vsd / count;
    mean.mssd += recall->mssd / count;
    mean.mspd += recall->mspd / count;
  }
  return mean;
}

}  // namespace tabletop_perception
