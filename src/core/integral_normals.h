#pragma once

#include <Eigen/Core>

#include "tabletop_perception/normals.h"

namespace tabletop_perception {

/// The methods of computeNormals by integral images of an organised cloud (Holzer et al. 2012,
/// "Adaptive neighborhood selection for real-time surface normal estimation from organized point
/// cloud data using integral images"). Each pixel has a square of its own: it grows with the range,
/// as the sensor's noise does (by its square in the paper, which leaves near surfaces rough), up to
/// the next jump in range, pixel without a point or border of the image. Pixels at one of these
/// have no normal.
Normals computeIntegralNormals(const Cloud& cloud, const Eigen::Vector3f& viewpoint,
                               const NormalsOptions& options);

}  // namespace tabletop_perception
