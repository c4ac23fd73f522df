#pragma once

#include <optional>

#include <Eigen/Core>

#include "tabletop_perception/geometry.h"

namespace tabletop_perception {

/// A line in the object's frame.
struct Axis {
  Eigen::Vector3d direction;  ///< unit length
  Eigen::Vector3d point;      ///< on it [m]
};

/// The axis about which most of a surface is one of revolution, whatever sticks out of it: a mug's,
/// with its handle. None where there is no such axis. `surface`: sampled evenly and all around.
///
/// The normals of a surface of revolution all meet its axis: they lie in a linear complex of lines
/// (Pottmann and Wallner, Computational Line Geometry, 2001). It is fitted by least squares,
/// weighted anew until what sticks out counts little.
std::optional<Axis> axisOfMost(const Surface& surface);

}  // namespace tabletop_perception
