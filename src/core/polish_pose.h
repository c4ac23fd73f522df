#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/agreement.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/refine.h"
#include "tabletop_perception/uncertainty.h"

namespace tabletop_perception {

struct PolishedPose {
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  PoseUncertainty uncertainty;
};

/// The last ICP of a pose that is right already: of nearly all points of the scene about the
/// object. The same pose where the picture speaks for that: the points of what touches a mug turn
/// it. `points`: in the order of the image, with others [m].
PolishedPose polishPose(const ModelIndex& index, int model,
                        const Eigen::Isometry3d& T_camera_object,
                        const std::vector<Eigen::Vector3f>& points, const Observation& observation,
                        const RefineOptions& refine);

}  // namespace tabletop_perception
