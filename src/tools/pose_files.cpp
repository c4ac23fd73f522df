#include "pose_files.h"

#include <cmath>
#include <stdexcept>

#include "evaluate.h"
#include "result_json.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr double ROTATION_TOLERANCE = 1e-3;  // of R R^T against the identity

}  // namespace

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

std::vector<NamedResult> readResults(const fs::path& file) {
  std::vector<NamedResult> results;
  visitJson(file, [&](const json& content) {
    visitObjects(content, file, [&](const std::string& name, const json& object) {
      NamedResult one;
      one.name = name;
      one.T_camera_object = poseFromParts(object.at("pose"));
      if (const auto score = object.find("score"); score != object.end())
        one.score = score->get<double>();
      if (const auto evidence = object.find("evidence"); evidence != object.end())
        one.evidence = evidenceFrom(*evidence);
      if (const auto rows = object.find("covariance"); rows != object.end())
        for (int r = 0; r < 6; ++r)
          for (int c = 0; c < 6; ++c) one.covariance(r, c) = rows->at(r).at(c).get<double>();
      const auto box = object.find("box");
      one.middle = box == object.end() ? one.T_camera_object.translation()
                                       : poseFromParts(box->at("pose")).translation();
      results.push_back(one);
    });
  });
  return results;
}

}  // namespace tabletop_perception::tools
