#pragma once

#include <Eigen/Geometry>

#include "outline.h"
#include "tabletop_perception/agreement.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/planar_surface.h"
#include "tabletop_perception/refine.h"

namespace tabletop_perception {

/// Of all turns that the points near a model say nothing about the one that agrees best with all
/// points and the picture, and then with the outline that is seen, laid on them again: ICP ends
/// with a mug on its body wherever the handle was at first. The same pose where no turn is free or
/// none agrees better. `points`: of the clusters that show the object, in the camera's frame.
/// `outline`: null where it is not known.
Eigen::Isometry3d bestFreeTurn(const ModelIndex& index, int model,
                               const Eigen::Isometry3d& T_camera_object,
                               const PlanarSurface& points, const Observation& observation,
                               const SeenOutline* outline, double tolerance,
                               const RefineOptions& refine);

}  // namespace tabletop_perception
