#pragma once

#include <map>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "scene_source.h"
#include "tabletop_perception/pipeline.h"

/// Results as tables for people, on stdout.
namespace tabletop_perception::tools {

/// The table and what stands on it. `up`: as the scene was segmented with.
void printSegmentation(const Scene& scene, const Segmentation& segmentation,
                       const std::optional<Eigen::Vector3d>& up);

/// The table, and what each thing on it is and where.
void printRecognition(const Scene& scene, const Recognition& recognition,
                      const std::optional<Eigen::Vector3d>& up);

}  // namespace tabletop_perception::tools
