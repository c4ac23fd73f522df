#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "benchmark_stages.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/packed_cloud.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception::tools {

/// A frame as it comes in, for both sides.
struct Frame {
  PackedCloud message;
  std::optional<Eigen::Vector3d> up;      ///< if it is known
  std::function<void()> stock_front_end;  ///< stock PCL's way from the message to clusters
};

/// Whole frames beside stock PCL's chain of the same parts: "frame" with one hypothesis for each of
/// the five largest clusters, "frame_verified" with up to five that are verified and decided
/// between; the chain has one. None where no cluster is large enough to be described.
std::vector<StageTiming> benchmarkFrame(const Frame& frame, const PipelineOptions& options,
                                        const ModelIndex& models, int runs);

}  // namespace tabletop_perception::tools
