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
/// explain lie right under it [m]. `parts`: the scene's sampled points; `explained`: those of them
/// that the object explains. `tables`: the main one first. `observations`: of the scene; where the
/// camera saw through below the object, nothing carries it. Null: not known.
double liftOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
              const std::vector<Surface>& parts, const Marks& explained,
              const std::vector<Table>& tables, const Observations* observations = nullptr);

}  // namespace tabletop_perception
