#pragma once

#include <Eigen/Geometry>

#include "tabletop_perception/agreement.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/planar_surface.h"
#include "tabletop_perception/refine.h"

namespace tabletop_perception {

/// A model turned as the picture has it about the axis about which most of it is of revolution, or
/// the one about which the points near it say nothing, and laid on them again: ICP ends with a mug
/// on its body wherever the handle was at first. The middle of the turns that are as likely, none
/// of them into the table. Without a projection, the turn that agrees best with the points. The
/// same pose where there is no such axis and where no turn is clearly better: a handle that is
/// hidden stays where it is. `points`: of the clusters that show the object, in the camera's frame.
Eigen::Isometry3d bestFreeTurn(const ModelIndex& index, int model,
                               const Eigen::Isometry3d& T_camera_object,
                               const PlanarSurface& points, const Observation& observation,
                               double tolerance, const RefineOptions& refine);

}  // namespace tabletop_perception
