#include "true_poses.h"

#include <cmath>
#include <stdexcept>

#include "evaluate.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr double ROTATION_TOLERANCE = 1e-3;  // of R R^T against the identity

/// [[r, r, r, t], [r, r, r, t], [r, r, r, t]]
Eigen::Isometry3d poseFromRows(const json& rows) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c) pose(r, c) = rows.at(r).at(c).get<double>();
  const Eigen::Matrix3d product = pose.linear() * pose.linear().transpose();
  if (!product.isIdentity(ROTATION_TOLERANCE) || pose.linear().determinant() < 0)
    throw std::invalid_argument("model_to_camera_3x4 must begin with a rotation, got " +
                                rows.dump());
  return pose;
}

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

Eigen::Isometry3d poseFromParts(const json& parts) {
  const auto& position = parts.at("position");
  const auto& orientation = parts.at("orientation");
  Eigen::Quaterniond rotation;
  for (int i = 0; i < 4; ++i) rotation.coeffs()[i] = orientation.at(i).get<double>();
  if (std::abs(rotation.norm() - 1) > ROTATION_TOLERANCE)
    throw std::invalid_argument("orientation must be a unit quaternion, got " + orientation.dump());
  Eigen::Isometry3d pose(rotation.normalized());
  for (int i = 0; i < 3; ++i) pose.translation()[i] = position.at(i).get<double>();
  return pose;
}

void visitObjects(const json& content, const fs::path& file,
                  const std::function<void(const std::string& name, const json& object)>& visit) {
  for (const auto& object : content.at("objects")) {
    const auto name = object.at("name").get<std::string>();
    if (name == "unknown") continue;
    try {
      visit(name, object);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(file.string() + ": " + name + ": " + error.what());
    }
  }
}

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
