#include "tabletop_perception/refine.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>

#include "icp_pairs.h"

namespace tabletop_perception {
namespace {

constexpr double SHRINK = 0.8;  // of the correspondence distance per iteration
constexpr double DAMPING =
    1e-2;  // of the normal equations' mean diagonal: free directions stay put
constexpr int MIN_POINTS = 6;
constexpr int MAX_IDLE_STEPS = 4;      // that bring the points no nearer
constexpr double MIN_PROGRESS = 1e-3;  // of their mean square, share
constexpr int SIZE = PlanarBlock::SIZE;

/// A small motion: a turn about `center`, then a shift.
Eigen::Isometry3d motionOf(const Vector6d& x, const Eigen::Vector3d& center) {
  const Eigen::Vector3d turn = x.head<3>();
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  if (turn.norm() > 0)
    motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  motion.translation() = center - motion.linear() * center + x.tail<3>();
  return motion;
}

/// The motion of the source that brings it onto the model, to first order.
Eigen::Isometry3d stepOf(NormalEquations equations, const Eigen::Vector3d& center) {
  auto diagonal = equations.A.diagonal();
  const double rotation = diagonal.head<3>().mean(), shift = diagonal.tail<3>().mean();
  diagonal.head<3>().array() += DAMPING * rotation + 1e-12;
  diagonal.tail<3>().array() += DAMPING * shift + 1e-12;
  return motionOf(equations.A.ldlt().solve(equations.b), center);
}

/// Whether steps still bring the points nearer: near its end ICP may go to and fro between pairs.
class Progress {
 public:
  bool isIdle() const { return idle_steps_ >= MAX_IDLE_STEPS; }

  void add(double mean_square) {
    ++idle_steps_;
    if (mean_square >= (1 - MIN_PROGRESS) * least_) return;
    least_ = mean_square;
    idle_steps_ = 0;
  }

 private:
  double least_ = std::numeric_limits<double>::infinity();
  int idle_steps_ = 0;
};

/// The rotation nearest to the pose's, against drift over many small steps.
void orthonormalize(Eigen::Isometry3d& T) {
  T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
}

/// How many points of a cluster there are, and the middle of them; those that are not finite do not
/// count.
struct Extent {
  int count = 0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
};

Extent extentOf(const PlanarSurface& cluster) {
  Extent extent;
  for (const auto& block : cluster.blocks)
    for (int i = 0; i < SIZE; ++i) {
      if (std::isnan(block.x[i])) continue;
      ++extent.count;
      extent.middle += Eigen::Vector3d(block.x[i], block.y[i], block.z[i]);
    }
  extent.middle /= std::max(1, extent.count);
  return extent;
}

/// The points that are finite, so that the others do not even change the order of sums.
PlanarSurface finitePoints(const PlanarSurface& cluster) {
  Surface finite;
  for (const auto& block : cluster.blocks)
    for (int i = 0; i < SIZE; ++i) {
      if (std::isnan(block.x[i])) continue;
      finite.points.emplace_back(block.x[i], block.y[i], block.z[i]);
      finite.normals.emplace_back(block.nx[i], block.ny[i], block.nz[i]);
    }
  return finite;
}

}  // namespace

Found<Alignment> refinePose(const PlanarSurface& cluster, const NearestGrid& model,
                            const Eigen::Isometry3d& T_camera_object,
                            const RefineOptions& options) {
  checkOptions("refine", options);
  const Extent extent = extentOf(cluster);
  if (extent.count < static_cast<int>(cluster.size))
    return refinePose(finitePoints(cluster), model, T_camera_object, options);
  Eigen::Isometry3d T_object_camera = T_camera_object.inverse();
  Alignment alignment;
  IcpPairs pairs(cluster);
  double distance = std::max(options.start_distance, options.max_distance);
  const bool stops_idle = options.min_rotation > 0 && options.min_translation > 0;
  Progress progress;
  for (; alignment.iterations < options.max_iterations && !alignment.converged;
       ++alignment.iterations) {
    pairs.find(model, T_object_camera, distance, options.trim);
    if (pairs.kept() < MIN_POINTS) break;
    const Eigen::Vector3d center = T_object_camera * extent.middle;
    const auto equations = normalEquations(pairs, center, options.method);
    const Eigen::Isometry3d step = stepOf(equations, center);
    T_object_camera = step * T_object_camera;
    orthonormalize(T_object_camera);

    if (distance <= options.max_distance) {
      progress.add(equations.cost / pairs.kept());
      alignment.converged = (angleOf(step.linear()) < options.min_rotation &&
                             (step * center - center).norm() < options.min_translation) ||
                            (stops_idle && progress.isIdle());
    }
    distance = std::max(options.max_distance, SHRINK * distance);
  }

  pairs.find(model, T_object_camera, options.max_distance, options.trim);
  alignment.overlap = static_cast<double>(pairs.found()) / std::max(1, extent.count);
  if (pairs.found() < MIN_POINTS || alignment.overlap < options.min_overlap) {
    char reason[160];
    std::snprintf(reason, sizeof reason,
                  "%.0f %% of the points lie on the model, limit %.0f %% (%d points)",
                  100 * alignment.overlap, 100 * options.min_overlap, pairs.found());
    return Found<Alignment>::none(reason);
  }
  alignment.T_camera_object = T_object_camera.inverse();
  alignment.rms = pairs.rms();
  return alignment;
}

}  // namespace tabletop_perception
