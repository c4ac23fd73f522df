#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/model_index.h"

namespace tabletop_perception {

/// Squared distance of a point from a model; infinite beyond the model's grid [m^2].
float squaredDistance(const ModelIndex& index, int model, const Eigen::Isometry3f& T_object_camera,
                      const Eigen::Vector3f& point);

/// At most `count` of the points within `reach` [m] of a model, evenly taken in their order, with
/// the normals of the model there.
Surface pointsNearModel(const ModelIndex& index, int model,
                        const Eigen::Isometry3d& T_camera_object,
                        const std::vector<Eigen::Vector3f>& points, double reach,
                        std::size_t count);

/// At most `count` of a surface's points, evenly taken in their order.
Surface thinned(const Surface& surface, std::size_t count);

}  // namespace tabletop_perception
