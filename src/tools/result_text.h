#pragma once

#include <cstdio>
#include <map>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "scene_source.h"
#include "tabletop_perception/pick_scene.h"
#include "tabletop_perception/pipeline.h"

/// Results as tables for people, on stdout.
namespace tabletop_perception::tools {

/// The table and what stands on it. `up`: as the scene was segmented with.
void printSegmentation(const Scene& scene, const Segmentation& segmentation,
                       const std::optional<Eigen::Vector3d>& up);

/// The table, and what each thing on it is and where.
void printRecognition(const Scene& scene, const Recognition& recognition,
                      const std::optional<Eigen::Vector3d>& up);

/// The thing that was pointed at, or why there is none.
void printPick(const Scene& scene, const Found<Pick>& pick,
               const std::optional<SceneObject>& object, const std::vector<PlacedGrasp>& grasps);

/// A row per stage, in their order, and the total [ms].
void printTimeTable(const std::map<std::string, double>& times_ms, std::FILE* to);

}  // namespace tabletop_perception::tools
