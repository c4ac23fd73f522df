#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/model.h"

namespace tabletop_perception {

/// Finds rotations that map a shape onto itself: a continuous axis, with a half
/// turn that turns it over if there is one, or turns by a half to a sixth of the circle. The
/// surface must be sampled evenly and all around. `tolerance`: the RMS distance of the turned
/// points from it that is still a symmetry, share of their RMS distance from the axis (a dented can
/// has 3.3 %, a banana 5 %, a mug 10 %). A ball is given one axis of its many; under 50 points
/// nothing is found.
Symmetry detectSymmetry(const Surface& surface, double tolerance = 0.04);

/// Three axes across each other that most of the surface's normals lie along, as columns: the sides
/// of a box. Each is the one nearest to an axis of the object's frame, so the sides of a box must
/// be within 45 degrees of these.
Eigen::Matrix3d dominantAxes(const Surface& surface);

/// A symmetry that a user states: "none", "axis x|y|z" (continuous), "half x|y|z" (a half turn),
/// "box" (three half turns), with `center` in the object's frame [m]. Throws std::invalid_argument
/// for other words.
Symmetry declaredSymmetry(const std::string& words, const Eigen::Vector3d& center);

/// The motions of the object's frame that change nothing, the identity first; a continuous axis is
/// sampled in `steps` turns.
std::vector<Eigen::Isometry3d> symmetryMotions(const Symmetry& symmetry, int steps = 72);

/// Whether an object looks the same at two poses: its centre of symmetry moves by `shift` [m] at
/// most and it turns by `turn` [rad] at most, up to its symmetry.
bool samePose(const Symmetry& symmetry, const Eigen::Isometry3d& T_camera_a,
              const Eigen::Isometry3d& T_camera_b, double shift, double turn);

/// Of all poses at which an object looks as it does at this one the one whose axes are turned least
/// from a reference's: frame after frame says the same then.
Eigen::Isometry3d canonicalPose(const Symmetry& symmetry, const Eigen::Isometry3d& T_camera_object,
                                const Eigen::Matrix3d& R_camera_reference);

}  // namespace tabletop_perception
