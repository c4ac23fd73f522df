#include "true_poses.h"

#include "evaluate.h"
#include "pose_files.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

/// What models_info.json says of the objects' symmetries, where it says something.
std::map<std::string, std::string> readSymmetries(const fs::path& models) {
  std::map<std::string, std::string> symmetries;
  const fs::path file = models / "models_info.json";
  if (!fs::exists(file)) return symmetries;
  visitJson(file, [&](const json& content) {
    for (const auto& [name, info] : content.items()) {
      const auto symmetry = info.find("symmetry");
      if (symmetry != info.end() && !symmetry->is_null())
        symmetries[name] = symmetry->get<std::string>();
    }
  });
  return symmetries;
}

}  // namespace

TrueObject trueObjectFrom(const json& object) {
  TrueObject one{
      {object.at("name").get<std::string>(), poseFromRows(object.at("model_to_camera_3x4"))},
      std::nullopt,
      object.value("moving", false)};
  if (const auto share = object.find("visible_share"); share != object.end())
    one.visible = share->get<double>();
  return one;
}

TrueModels readTrueModels(const fs::path& folder, const std::set<std::string>& names) {
  checkFolder(folder, "--models");
  auto symmetries = readSymmetries(folder);
  TrueModels models;
  for (const auto& name : names) {
    const auto mesh = readMesh(folder / name / "mesh.ply", 1);
    models.reference.emplace(name, makeReferenceModel(mesh, symmetries[name]));
    models.renderers.try_emplace(name, mesh);
  }
  return models;
}

}  // namespace tabletop_perception::tools
