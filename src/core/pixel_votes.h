#pragma once

#include <Eigen/Geometry>

#include "tabletop_perception/agreement.h"
#include "tabletop_perception/geometry.h"

namespace tabletop_perception {

/// The area in which pixels say no more than one would [m^2]: by so much less a pose is off, to be
/// e times as likely.
constexpr double VOTES_ALIKE = 6e-5;

/// What the pixels that a model covers at a pose say against it, less what they say for it [m^2].
/// One that shows the model where it is speaks for it, one that shows something farther away
/// against it, and a little so one that shows something nearer, which may hide it or may not.
/// Pixels without depth say nothing, nor do those at an edge, which may be a pixel off. A vote
/// weighs as much as the area that a pixel has there. `model`: with normals, in its own frame,
/// about 3 mm between its points. `observation`: with a projection.
double votesAgainst(const Observation& observation, const Surface& model,
                    const Eigen::Isometry3d& T_camera_model);

}  // namespace tabletop_perception
