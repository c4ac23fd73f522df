#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/nearest_grid.h"
#include "tabletop_perception/planar_surface.h"

namespace tabletop_perception {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// The correspondences of a cluster with a model at a pose, in the model's frame.
class IcpPairs {
 public:
  explicit IcpPairs(const PlanarSurface& cluster);

  /// Finds them anew, none farther than `max_distance`, and keeps the nearest `trim` of them.
  void find(const NearestGrid& model, const Eigen::Isometry3d& T_object_camera, double max_distance,
            double trim);

  int found() const { return static_cast<int>(found_); }
  int kept() const { return static_cast<int>(kept_); }
  double rms() const;  ///< of the distances of those kept [m]

  /// Calls visit(block, i, block of the cluster) for each that is kept.
  template <typename Visit>
  void visitKept(Visit visit) const {
    for (std::size_t b = 0; b < blocks_.size(); ++b)
      for (int i = 0; i < Correspondences::SIZE; ++i)
        if (blocks_[b].squared[i] <= farthest_) visit(blocks_[b], i, cluster_.blocks[b]);
  }

  const std::vector<Correspondences>& blocks() const { return blocks_; }
  float farthest() const { return farthest_; }  ///< squared distance of those kept [m^2]
  const Eigen::Isometry3d& pose() const { return T_object_camera_; }

 private:
  void keepNearest(double trim, float bins_per_squared);

  const PlanarSurface& cluster_;
  Eigen::Isometry3d T_object_camera_ = Eigen::Isometry3d::Identity();
  std::vector<Correspondences> blocks_;
  std::vector<std::uint8_t> bins_;  // of their squared distances
  std::vector<float> of_last_bin_;
  std::size_t found_ = 0, kept_ = 0;
  float farthest_ = -1;
};

/// Least squares A x = b for a small motion of the cluster in the model's frame: a turn about a
/// centre [rad], then a shift [m].
struct NormalEquations {
  Matrix6d A = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
};

/// What brings the pairs together, by what is measured between them: "point_to_plane", the distance
/// from the model's tangent planes; "point_to_point"; or "gicp", Mahalanobis distances of two
/// surfaces that are flat about their points (Segal, Haehnel, Thrun 2009).
NormalEquations normalEquations(const IcpPairs& pairs, const Eigen::Vector3d& center,
                                const std::string& method);

}  // namespace tabletop_perception
