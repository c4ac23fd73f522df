#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "evaluate_poses.h"

/// Poses in the files of a truth and of results. All throw std::invalid_argument with the file's
/// name for what is not as it should be.
namespace tabletop_perception::tools {

/// [[r, r, r, t], [r, r, r, t], [r, r, r, t]]
Eigen::Isometry3d poseFromRows(const nlohmann::json& rows);

/// {"position": [x, y, z], "orientation": [x, y, z, w]}
Eigen::Isometry3d poseFromParts(const nlohmann::json& parts);

/// Visits the `objects` of a file but for those named "unknown".
void visitObjects(
    const nlohmann::json& content, const std::filesystem::path& file,
    const std::function<void(const std::string& name, const nlohmann::json& object)>& visit);

/// What a result of `recognize --output` gives a name.
std::vector<NamedResult> readResults(const std::filesystem::path& file);

}  // namespace tabletop_perception::tools
