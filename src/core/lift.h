#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "marks.h"
#include "tabletop_perception/agreement.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

/// Height of an object's lowest point above the table that it is over, below zero in it; 0 without
/// a table, and where something else carries the object: points of the scene that it does not
/// explain lie right under it, and the camera does not see past what is under these [m]. `parts`:
/// the scene's sampled points; `explained`: those of them that the object explains. `tables`: the
/// main one first.
double liftOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
              const std::vector<Surface>& parts, const Marks& explained,
              const Observations& observations, const std::vector<Table>& tables);

}  // namespace tabletop_perception
