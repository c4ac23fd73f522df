#include "tabletop_perception/refine.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <Eigen/Cholesky>

namespace tabletop_perception {
namespace {

// Correspondences whose normals differ more are none. Opposite ones agree: the nearest point of a
// thin wall may lie on its other side.
constexpr float MIN_NORMAL_DOT = 0.5f;
constexpr double SHRINK = 0.8;  // of the correspondence distance per iteration
constexpr double DAMPING =
    1e-2;  // of the normal equations' mean diagonal: free directions stay put
constexpr int MIN_POINTS = 6;

struct Correspondence {
  Eigen::Vector3f source;  // in the object's frame, at the current pose [m]
  int target;              // index of a model point
  float squared_distance;  // [m^2]
};

/// Nearest model points of the cluster at a pose, none farther than `max_distance`; the nearest
/// `trim` of them.
std::vector<Correspondence> correspondences(const Surface& cluster, const Surface& model,
                                            const NearestGrid& grid,
                                            const Eigen::Isometry3d& T_object_camera,
                                            double max_distance, double trim) {
  const Eigen::Isometry3f T = T_object_camera.cast<float>();
  const auto limit = static_cast<float>(max_distance * max_distance);
  std::vector<Correspondence> pairs;
  pairs.reserve(cluster.size());
  for (std::size_t i = 0; i < cluster.size(); ++i) {
    if (!cluster.points[i].allFinite()) continue;
    const Eigen::Vector3f p = T * cluster.points[i];
    const int nearest = grid.nearest(p);
    if (nearest < 0) continue;
    const float squared_distance = (model.points[nearest] - p).squaredNorm();
    if (squared_distance > limit) continue;
    const Eigen::Vector3f normal = T.linear() * cluster.normals[i];
    if (std::abs(normal.dot(model.normals[nearest])) < MIN_NORMAL_DOT) continue;
    pairs.push_back({p, nearest, squared_distance});
  }
  const auto kept = static_cast<std::size_t>(std::ceil(trim * static_cast<double>(pairs.size())));
  if (kept < pairs.size()) {
    std::nth_element(pairs.begin(), pairs.begin() + kept, pairs.end(),
                     [](const Correspondence& a, const Correspondence& b) {
                       return a.squared_distance < b.squared_distance;
                     });
    pairs.resize(kept);
  }
  return pairs;
}

/// The motion of the source that brings it onto the targets' tangent planes, to first order.
Eigen::Isometry3d stepToPlanes(const std::vector<Correspondence>& pairs, const Surface& model) {
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const auto& pair : pairs) center += pair.source.cast<double>();
  center /= static_cast<double>(pairs.size());
  for (const auto& pair : pairs) {
    const Eigen::Vector3d n = model.normals[pair.target].cast<double>();
    const Eigen::Vector3d p = pair.source.cast<double>();
    Eigen::Matrix<double, 6, 1> row;
    row << (p - center).cross(n), n;
    A += row * row.transpose();
    b += row * n.dot(model.points[pair.target].cast<double>() - p);
  }
  const double rotation = A.diagonal().head<3>().mean(), shift = A.diagonal().tail<3>().mean();
  A.diagonal().head<3>().array() += DAMPING * rotation + 1e-12;
  A.diagonal().tail<3>().array() += DAMPING * shift + 1e-12;
  const Eigen::Matrix<double, 6, 1> x = A.ldlt().solve(b);

  const Eigen::Vector3d turn = x.head<3>();
  Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
  if (turn.norm() > 0)
    step.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  step.translation() = center - step.linear() * center + x.tail<3>();
  return step;
}

/// The motion of the source with the least squared distances from the targets (Umeyama 1991).
Eigen::Isometry3d stepToPoints(const std::vector<Correspondence>& pairs, const Surface& model) {
  Eigen::Matrix3Xd source(3, pairs.size()), target(3, pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    source.col(i) = pairs[i].source.cast<double>();
    target.col(i) = model.points[pairs[i].target].cast<double>();
  }
  return Eigen::Isometry3d(Eigen::umeyama(source, target, false));
}

double rmsOf(const std::vector<Correspondence>& pairs) {
  double sum = 0;
  for (const auto& pair : pairs) sum += pair.squared_distance;
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

/// The rotation nearest to the pose's, against drift over many small steps.
void orthonormalize(Eigen::Isometry3d& T) {
  T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
}

}  // namespace

Found<Alignment> refinePose(const Surface& cluster, const Surface& model, const NearestGrid& grid,
                            const Eigen::Isometry3d& T_camera_object,
                            const RefineOptions& options) {
  checkOptions("refine", options);
  const bool to_planes = options.method == "point_to_plane";
  Eigen::Isometry3d T_object_camera = T_camera_object.inverse();
  Alignment alignment;
  double distance = std::max(options.start_distance, options.max_distance);
  for (; alignment.iterations < options.max_iterations && !alignment.converged;
       ++alignment.iterations) {
    const auto pairs =
        correspondences(cluster, model, grid, T_object_camera, distance, options.trim);
    if (static_cast<int>(pairs.size()) < MIN_POINTS) break;
    const Eigen::Isometry3d step =
        to_planes ? stepToPlanes(pairs, model) : stepToPoints(pairs, model);
    T_object_camera = step * T_object_camera;
    orthonormalize(T_object_camera);

    const double shift =
        (step * pairs.front().source.cast<double>() - pairs.front().source.cast<double>()).norm();
    alignment.converged = distance <= options.max_distance &&
                          angleOf(step.linear()) < options.min_rotation &&
                          shift < options.min_translation;
    distance = std::max(options.max_distance, SHRINK * distance);
  }

  const auto all = correspondences(cluster, model, grid, T_object_camera, options.max_distance, 1);
  const auto finite = std::count_if(cluster.points.begin(), cluster.points.end(),
                                    [](const auto& p) { return p.allFinite(); });
  alignment.overlap = static_cast<double>(all.size()) / std::max<double>(1, finite);
  if (static_cast<int>(all.size()) < MIN_POINTS || alignment.overlap < options.min_overlap) {
    char reason[160];
    std::snprintf(reason, sizeof reason,
                  "%.0f %% of the points lie on the model, limit %.0f %% (%zu points)",
                  100 * alignment.overlap, 100 * options.min_overlap, all.size());
    return Found<Alignment>::none(reason);
  }
  alignment.T_camera_object = T_object_camera.inverse();
  alignment.rms = rmsOf(
      correspondences(cluster, model, grid, T_object_camera, options.max_distance, options.trim));
  return alignment;
}

}  // namespace tabletop_perception
