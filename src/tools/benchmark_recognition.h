#pragma once

#include <vector>

#include "benchmark_stages.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception::tools {

/// Ours and stock PCL's stages of recognition on the things that stand in a scene, on one thread:
/// `vfh` of every cluster, `icp` of the best candidate of the largest one, `search` of its vector
/// among 10,000. None where no cluster is large enough to be described; no `icp` where nothing in
/// the database resembles the largest.
std::vector<StageTiming> benchmarkRecognition(const Segmentation& segmentation,
                                              const ModelIndex& models, int runs);

/// An index with `rows` VFH vectors, those of `models` over and over with a little noise on them.
/// Throws std::invalid_argument if `models` has none.
ModelIndex manyVectors(const ModelIndex& models, int rows);

}  // namespace tabletop_perception::tools
