#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/agreement.h"
#include "tabletop_perception/cloud.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/refine.h"

namespace tabletop_perception {

/// Points of a scene that a model may explain.
struct ModelCut {
  std::string name;  ///< of the model
  Indices points;
};

/// Of the points that stand on the observed table those that a model would explain which shows a
/// point of them to the camera, for things that no gap and no hollow parts. The most promising
/// model first, none whose surface goes on beyond the model: it would be a part of something
/// larger. `point`: one of them, in the camera's frame [m].
std::vector<ModelCut> cutsByModels(const Observation& observation, const Indices& standing,
                                   const Eigen::Vector3f& point, const ModelIndex& index,
                                   const RefineOptions& refine);

}  // namespace tabletop_perception
