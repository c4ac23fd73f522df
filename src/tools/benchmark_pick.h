#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "benchmark_stages.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception::tools {

/// Ours and stock PCL's steps from a point on the largest thing of a scene to a frame on it, on one
/// thread, and both ways as a whole; `cloud` is as the camera sent it. None of an unorganised
/// cloud, and where nothing can be picked.
std::vector<StageTiming> benchmarkPick(const Cloud& cloud, const Segmentation& segmentation,
                                       const std::optional<Eigen::Vector3d>& up,
                                       const PipelineOptions& options, int runs);

}  // namespace tabletop_perception::tools
