#include "tabletop_perception/refine.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <Eigen/Cholesky>

#include "icp_pairs.h"

namespace tabletop_perception {
namespace {

constexpr double SHRINK = 0.8;  // of the correspondence distance per iteration
constexpr double DAMPING =
    1e-2;  // of the normal equations' mean diagonal: free directions stay put
constexpr int MIN_POINTS = 6;
constexpr std::size_t LONGEST_CYCLE = 6;  // of poses that ICP goes through over and over
constexpr double SAME_POSE = 0.2;         // of the least step, where ICP comes back to
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
Eigen::Isometry3d stepOf(const IcpPairs& pairs, const Eigen::Vector3d& center,
                         const std::string& method) {
  auto equations = normalEquations(pairs, center, method);
  auto diagonal = equations.A.diagonal();
  const double rotation = diagonal.head<3>().mean(), shift = diagonal.tail<3>().mean();
  diagonal.head<3>().array() += DAMPING * rotation + 1e-12;
  diagonal.tail<3>().array() += DAMPING * shift + 1e-12;
  return motionOf(equations.A.ldlt().solve(equations.b), center);
}

/// The last poses of a cluster in the model's frame. Near its end ICP may go to and fro between
/// pairs of points for ever.
class Trail {
 public:
  Trail(const Eigen::Vector3d& middle, const RefineOptions& options)
      : middle_(middle), options_(options) {}

  /// Whether a pose is the last one up to the least step, or an earlier one up to much less: then
  /// it gets no farther.
  bool endsAt(const Eigen::Isometry3d& T_object_camera) const {
    return std::any_of(last_.begin(), last_.end(), [&](const Eigen::Isometry3d& other) {
      const double share = &other == &last_.back() ? 1 : SAME_POSE;
      return (T_object_camera * middle_ - other * middle_).norm() <
                 share * options_.min_translation &&
             angleOf(T_object_camera.linear() * other.linear().transpose()) <
                 share * options_.min_rotation;
    });
  }

  void add(const Eigen::Isometry3d& T_object_camera) {
    if (last_.size() == LONGEST_CYCLE) last_.erase(last_.begin());
    last_.push_back(T_object_camera);
  }

 private:
  const Eigen::Vector3d middle_;
  const RefineOptions& options_;
  std::vector<Eigen::Isometry3d> last_;
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
  Trail trail(extent.middle, options);
  for (; alignment.iterations < options.max_iterations && !alignment.converged;
       ++alignment.iterations) {
    pairs.find(model, T_object_camera, distance, options.trim);
    if (pairs.kept() < MIN_POINTS) break;
    const Eigen::Vector3d center = T_object_camera * extent.middle;
    if (distance <= options.max_distance) trail.add(T_object_camera);
    T_object_camera = stepOf(pairs, center, options.method) * T_object_camera;
    orthonormalize(T_object_camera);
    alignment.converged = trail.endsAt(T_object_camera);
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
