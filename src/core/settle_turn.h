#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "outline.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/refine.h"
#include "tabletop_perception/surface_color.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

struct SettledPose {
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  double rms = 0;               ///< distance of the points about it from its tangent planes [m]
  std::optional<double> color;  ///< likeness of the colours, where they were compared
  double probability = 1;       ///< of this turn, among those that look nearly alike
};

/// Of all turns of a nearly symmetric object the one that fits its points, their colours, their
/// outline and the table best, turned about an axis of symmetry as the colours have it. `points`:
/// of the scene; those about the object count [m]. `colored`: some of them, or none. `outline`:
/// null where it is not known. `tables`: the main one first. None where no point is near the
/// object.
std::optional<SettledPose> settleTurn(const ModelIndex& index, int model,
                                      const Eigen::Isometry3d& T_camera_object,
                                      const std::vector<Eigen::Vector3f>& points,
                                      const ColoredPoints& colored, const SeenOutline* outline,
                                      const std::vector<Table>& tables,
                                      const RefineOptions& refine);

}  // namespace tabletop_perception
