#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/model_index.h"
#include "tabletop_perception/refine.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

struct SettledPose {
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  double rms = 0;  ///< distance of the points about it from its tangent planes [m]
};

/// Of all turns of a nearly symmetric object the one that fits its points and the table best.
/// Another than the one at hand has to be the better by a fair gain in log likelihood, where points
/// whose neighbours are off as they are count for less than independent ones. `points`: of the
/// scene, in the order of their clusters; those about the object count [m]. `tables`: the main one
/// first. None where no point is near the object.
std::optional<SettledPose> settleTurn(const ModelIndex& index, int model,
                                      const Eigen::Isometry3d& T_camera_object,
                                      const std::vector<Eigen::Vector3f>& points,
                                      const std::vector<Table>& tables,
                                      const RefineOptions& refine);

}  // namespace tabletop_perception
