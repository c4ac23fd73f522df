#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/agreement.h"

namespace tabletop_perception {

/// Points of a scene with the mean colour about each. No points where the scene has no colour: none
/// at all, or every point is grey.
struct ColoredPoints {
  std::vector<Eigen::Vector3f> points;  ///< in the camera's frame [m]
  std::vector<Rgb> colors;              ///< as many
};

/// At most `most` of some points on surfaces of the scene [m], evenly taken.
ColoredPoints coloredPoints(const Observation& observation,
                            const std::vector<Eigen::Vector3f>& points, std::size_t most);

/// How much points of a scene look like the points of a model that lie nearest to them at a pose: 1
/// for equal colours, about 0 where they have nothing in common. Brightness may differ by a factor,
/// and the light may have a tint. None where the model or the scene has no colour, or where too few
/// points lie within `tolerance` of the model to tell.
std::optional<double> colorLikeness(const ModelIndex& index, int model,
                                    const Eigen::Isometry3d& T_camera_object,
                                    const ColoredPoints& points, double tolerance);

/// The largest likeness over the turns after which a model has the same shape, or nearly: before it
/// is decided which of them the pose should have.
std::optional<double> bestColorLikeness(const ModelIndex& index, int model,
                                        const Eigen::Isometry3d& T_camera_object,
                                        const ColoredPoints& points, double tolerance);

}  // namespace tabletop_perception
