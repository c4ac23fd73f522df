#pragma once

#include <optional>

#include <Eigen/Core>

#include "tabletop_perception/cloud.h"

namespace tabletop_perception {

/// The plane a x + b y + c z + d = 0 (unit normal of either sign) that the most points of a thing
/// lie within `distance` [m] of: several are drawn, and the best of them is turned and shifted for
/// as long as it gains points. On a thing that bends, one draw ends anywhere. None when no three
/// points span one. Same input, same plane.
std::optional<Eigen::Vector4d> mainPlane(const Cloud& thing, double distance);

}  // namespace tabletop_perception
