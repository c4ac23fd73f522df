#pragma once

#include <Eigen/Core>

#include "tabletop_perception/normals.h"

namespace tabletop_perception {

/// The method "window" of computeNormals: covariances of windows masked by range, many pixels at
/// once. Every `step`-th pixel of every `step`-th row is computed, those between follow; see
/// NormalsOptions.
Normals computeGridNormals(const Cloud& cloud, const Eigen::Vector3f& viewpoint,
                           const NormalsOptions& options);

}  // namespace tabletop_perception
