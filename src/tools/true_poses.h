#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "tabletop_perception/mesh.h"
#include "tabletop_perception/pose_metrics.h"

/// Scenes with known poses, as gt.json files state them, and the objects' meshes.
namespace tabletop_perception::tools {

/// An object of the truth.
struct TrueObject : PosedObject {
  std::optional<double> visible;  ///< share of it that the camera sees, where the truth says it
  bool moving = false;            ///< it need not be found
};

/// The objects of the truth, by name.
struct TrueModels {
  std::map<std::string, ReferenceModel> reference;
  std::map<std::string, MeshRenderer> renderers;
};

/// From an object of a gt.json.
TrueObject trueObjectFrom(const nlohmann::json& object);

/// The models of the named objects: `folder`/NAME/mesh.ply [m], and what models_info.json there
/// says of their symmetries.
TrueModels readTrueModels(const std::filesystem::path& folder, const std::set<std::string>& names);

}  // namespace tabletop_perception::tools
