#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/nearest_grid.h"
#include "tabletop_perception/planar_surface.h"
#include "tabletop_perception/refine.h"

namespace tabletop_perception {

/// How far a pose may be off.
struct PoseUncertainty {
  /// Of the error: x, y, z of the object's origin [m], then the turn about the axes x, y, z [rad],
  /// both along the axes of the camera's frame, as geometry_msgs/PoseWithCovariance has them. The
  /// true origin is the estimated one shifted, the true rotation the estimated one turned.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  /// Directions of the six that the points say nothing of: 3 for a plane, 1 for the turn of a can.
  /// There the covariance is that of a thing which may be off by its own size.
  int free_directions = 0;
};

/// The uncertainty of a pose that refinePose ended at, from the normal equations of its
/// correspondences: (J^T J)^-1 times the variance that the points' distances from the model's
/// tangent planes have beside each other. What neighbouring points are off alike does not average
/// out over their number (a model or a camera that is wrong there), and counts in whole in every
/// direction. `cluster`: in the order of the image. No correspondence: all directions are free.
PoseUncertainty uncertaintyOf(const PlanarSurface& cluster, const NearestGrid& model,
                              const Eigen::Isometry3d& T_camera_object,
                              const RefineOptions& options);

/// A covariance as above along the axes of another frame, into which R turns.
Eigen::Matrix<double, 6, 6> turnedCovariance(const Eigen::Matrix<double, 6, 6>& covariance,
                                             const Eigen::Matrix3d& R_target_camera);

}  // namespace tabletop_perception
