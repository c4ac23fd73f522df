#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "scene_source.h"
#include "tabletop_perception/pick_scene.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception::tools {

/// Position [m] and quaternion x y z w of a pose; `sensor` as in Scene.
nlohmann::ordered_json poseJson(const Eigen::Isometry3d& pose, const Eigen::Vector3d& sensor);

/// What `recognize --json` prints for a scene (docs/command_line.md). Positions are in the scene's
/// own frame, objects are numbered from 1.
nlohmann::ordered_json recognitionJson(const Scene& scene, const Recognition& recognition);

/// What `segment --json` prints: the same without names and scores.
nlohmann::ordered_json segmentationJson(const Scene& scene, const Segmentation& segmentation);

/// What `pick --json` prints: the object, with the plane of its table and the frames to grasp it
/// by. `object`: what it was recognised as, if that was asked, and its stored grasps. Where there
/// is none: only the reason.
nlohmann::ordered_json pickJson(const Scene& scene, const Found<Pick>& pick,
                                const std::optional<SceneObject>& object,
                                const std::vector<PlacedGrasp>& grasps);

/// The `evidence` of an object, and back. Throws nlohmann::json::exception where a number is
/// missing.
nlohmann::ordered_json evidenceJson(const Evidence& evidence);
Evidence evidenceFrom(const nlohmann::json& json);

/// JSON as one line, with its end; bytes that are not UTF-8 (of a file's name) are replaced.
std::string jsonLine(const nlohmann::ordered_json& json);

/// The clusters of a segmentation as objects that nobody tried to name.
std::vector<SceneObject> clusterObjects(const Segmentation& segmentation);

}  // namespace tabletop_perception::tools
