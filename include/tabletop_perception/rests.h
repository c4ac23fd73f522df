#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tabletop_perception {

/// A way in which an object lies still on a table.
struct Rest {
  /// The lowest vertex is at z = 0, z is up; the centre of mass is above the origin.
  Eigen::Isometry3d T_table_object = Eigen::Isometry3d::Identity();
  double probability = 0;  ///< that a dropped object ends so
};

/// The faces of the convex hull that an object rests on, the most probable first: dropped in a
/// random orientation, it lands on the face below its centre of mass and rolls over edges until the
/// centre is above the face (Goldberg et al., Part Pose Statistics, 1999). Faces within 2 degrees
/// count as one. The mass is taken to fill the convex hull evenly. Probabilities sum to 1. Throws
/// std::invalid_argument for vertices that span no volume.
std::vector<Rest> stableRests(const std::vector<Eigen::Vector3f>& vertices);

}  // namespace tabletop_perception
