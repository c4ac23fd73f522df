#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <stdexcept>

#include "evaluate.h"
#include "tabletop_perception/pose_metrics.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

namespace {

constexpr double ROTATION_TOLERANCE = 1e-3;  // of R R^T against the identity

/// A scene of the truth, and how its result came out.
struct PosedScene {
  std::string name;
  std::vector<PosedObject> truth;
  bool has_result = false;
  PoseScore score;
  /// Height of each true object's lowest vertex above the table that was found [m]; of things that
  /// stand on it: how far the table is off. Empty without a table.
  std::vector<double> lowest;
};

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

/// {"position": [x, y, z], "orientation": [x, y, z, w]}
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

/// The `objects` of a file; those named "unknown" are left out.
std::vector<PosedObject> readObjects(const fs::path& file,
                                     Eigen::Isometry3d (*pose_of)(const json& object)) {
  std::vector<PosedObject> objects;
  visitJson(file, [&](const json& content) {
    for (const auto& object : content.at("objects")) {
      const auto name = object.at("name").get<std::string>();
      if (name == "unknown") continue;
      try {
        objects.push_back({name, pose_of(object)});
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(file.string() + ": " + name + ": " + error.what());
      }
    }
  });
  return objects;
}

std::vector<PosedObject> readTruth(const fs::path& file) {
  return readObjects(
      file, [](const json& object) { return poseFromRows(object.at("model_to_camera_3x4")); });
}

std::vector<PosedObject> readResult(const fs::path& file) {
  return readObjects(file, [](const json& object) { return poseFromParts(object.at("pose")); });
}

/// The `table` of a result; none if it is null.
std::optional<Eigen::Vector4d> readTablePlane(const fs::path& file) {
  std::optional<Eigen::Vector4d> plane;
  visitJson(file, [&](const json& content) {
    const auto table = content.find("table");
    if (table == content.end() || table->is_null()) return;
    plane.emplace();
    for (int i = 0; i < 4; ++i) (*plane)[i] = table->at("plane").at(i).get<double>();
  });
  return plane;
}

std::vector<double> lowestVertices(const std::vector<PosedObject>& truth,
                                   const std::map<std::string, ReferenceModel>& models,
                                   const Eigen::Vector4d& plane) {
  std::vector<double> lowest;
  for (const auto& object : truth) {
    const Eigen::Vector4d in_object = object.T_camera_object.matrix().transpose() * plane;
    double least = std::numeric_limits<double>::max();
    for (const auto& vertex : models.at(object.name).vertices.points())
      least = std::min(least, in_object.head<3>().dot(vertex.cast<double>()) + in_object[3]);
    lowest.push_back(least);
  }
  return lowest;
}

/// The folders with a gt.json, by name.
std::vector<PosedScene> readScenes(const fs::path& truth) {
  checkFolder(truth, "--poses");
  std::map<std::string, fs::path> files;
  for (const auto& entry : fs::directory_iterator(truth))
    if (fs::exists(entry.path() / "gt.json"))
      files[entry.path().filename()] = entry.path() / "gt.json";
  if (files.empty())
    throw std::invalid_argument(
        "--poses must be a folder of folders with a gt.json, there is "
        "none in " +
        truth.string());
  std::vector<PosedScene> scenes;
  for (const auto& [name, file] : files) scenes.push_back({name, readTruth(file), false, {}, {}});
  return scenes;
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

/// The models of all objects in the truth.
std::map<std::string, ReferenceModel> readModels(const fs::path& models,
                                                 const std::vector<PosedScene>& scenes) {
  checkFolder(models, "--models");
  auto symmetries = readSymmetries(models);
  std::map<std::string, ReferenceModel> read;
  for (const auto& scene : scenes)
    for (const auto& object : scene.truth) {
      if (read.count(object.name) > 0) continue;
      const auto mesh = readMesh(models / object.name / "mesh.ply", 1);
      read.emplace(object.name, makeReferenceModel(mesh, symmetries[object.name]));
    }
  return read;
}

std::vector<PoseScore> scoresOf(const std::vector<PosedScene>& scenes) {
  std::vector<PoseScore> scores;
  for (const auto& scene : scenes) scores.push_back(scene.score);
  return scores;
}

/// "-3.1 to 0.2" [mm]
std::string lowestText(const std::vector<double>& lowest) {
  if (lowest.empty()) return "no table";
  const auto [least, most] = std::minmax_element(lowest.begin(), lowest.end());
  return formatted(*least, 1000, 1) + " to " + formatted(*most, 1000, 1);
}

std::vector<std::string> rowOf(const std::string& name, const PoseSummary& summary) {
  const auto percent = [](std::optional<double> share) { return formatted(share, 100, 1); };
  return {name,
          std::to_string(summary.right) + "/" + std::to_string(summary.objects),
          percent(summary.rightShare()),
          percent(summary.closeShare()),
          percent(summary.add_s_auc),
          percent(summary.namedShare()),
          std::to_string(summary.right) + "/" + std::to_string(summary.results),
          percent(summary.precision()),
          formatted(summary.median_translation, 1000, 1)};
}

void printText(const std::vector<PosedScene>& scenes) {
  const auto scores = scoresOf(scenes);
  std::vector<std::vector<std::string>> rows;
  rows.push_back({"", "right", "right %", "ADD-S %", "AUC %", "named %", "of results",
                  "precision %", "median mm", "lowest above table mm"});
  for (const auto& scene : scenes) {
    rows.push_back(rowOf(scene.name, summarize({scene.score})));
    rows.back().push_back(lowestText(scene.lowest));
  }
  rows.emplace_back();
  for (const auto& name : namesIn(scores))
    rows.push_back(rowOf(name, summarize(ofName(scores, name))));
  rows.emplace_back();
  rows.push_back(rowOf("all " + std::to_string(scenes.size()) + " scenes", summarize(scores)));
  printColumns(rows);
}

ordered_json summaryJson(const PoseSummary& summary) {
  return {{"objects", summary.objects},
          {"results", summary.results},
          {"right", summary.right},
          {"right_recall", orNull(summary.rightShare())},
          {"add_s_recall", orNull(summary.closeShare())},
          {"add_s_auc", orNull(summary.add_s_auc)},
          {"named_recall", orNull(summary.namedShare())},
          {"precision", orNull(summary.precision())},
          {"median_translation", orNull(summary.median_translation)}};
}

ordered_json outcomeJson(const PoseOutcome& outcome) {
  const auto figure = [&](double PoseError::*member) {
    return outcome.error ? ordered_json((*outcome.error).*member) : ordered_json();
  };
  return {{"name", outcome.name},
          {"right", outcome.right()},
          {"mssd", figure(&PoseError::mssd)},
          {"add_s", figure(&PoseError::add_s)},
          {"translation", figure(&PoseError::translation)},
          {"diameter", outcome.diameter}};
}

ordered_json sceneJson(const PosedScene& scene) {
  ordered_json json = {{"scene", scene.name}, {"has_result", scene.has_result}};
  json.update(summaryJson(summarize({scene.score})));
  json["matches"] = ordered_json::array();
  for (const auto& outcome : scene.score.truth) json["matches"].push_back(outcomeJson(outcome));
  json["lowest_above_table"] = scene.lowest;  // in the order of the truth
  return json;
}

void printJson(const std::vector<PosedScene>& scenes) {
  const auto scores = scoresOf(scenes);
  ordered_json json = {{"scenes", ordered_json::array()}, {"objects", ordered_json::array()}};
  for (const auto& scene : scenes) json["scenes"].push_back(sceneJson(scene));
  for (const auto& name : namesIn(scores)) {
    json["objects"].push_back({{"name", name}});
    json["objects"].back().update(summaryJson(summarize(ofName(scores, name))));
  }
  json["all"] = {{"scenes", scenes.size()}};
  json["all"].update(summaryJson(summarize(scores)));
  std::printf("%s\n", json.dump().c_str());
}

}  // namespace

void evaluatePoses(const fs::path& truth, const fs::path& models, const fs::path& results,
                   bool json) {
  auto scenes = readScenes(truth);
  std::vector<std::string> names;
  for (const auto& scene : scenes) names.push_back(scene.name);
  const auto result_files = findResults(results, names, ".json");
  const auto reference = readModels(models, scenes);
  for (auto& scene : scenes) {
    const auto result = result_files.find(scene.name);
    scene.has_result = result != result_files.end();
    const auto found = scene.has_result ? readResult(result->second) : std::vector<PosedObject>{};
    scene.score = scorePoses(scene.truth, found, reference);
    if (!scene.has_result) continue;
    if (const auto plane = readTablePlane(result->second))
      scene.lowest = lowestVertices(scene.truth, reference, *plane);
  }
  json ? printJson(scenes) : printText(scenes);
}

}  // namespace tabletop_perception::tools
