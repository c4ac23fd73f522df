#pragma once

#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/agreement.h"
#include "tabletop_perception/match.h"
#include "tabletop_perception/model_index.h"

namespace tabletop_perception {

/// The poses in which models stand on the observed table and show the camera a point of their
/// surface with its normal, in the camera's frame [m, unit]: what a thing may be, of which no
/// cluster is known but this point. The `most` most promising of them, in that order: those of
/// which the picture shows most, and little speaks against. None without a table or a projection.
std::vector<Candidate> standsAt(const Eigen::Vector3f& point, const Eigen::Vector3f& normal,
                                const Observation& observation, const ModelIndex& index, int most);

}  // namespace tabletop_perception
