#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "evaluate.h"
#include "evaluate_poses.h"
#include "fit_score.h"
#include "pose_files.h"
#include "report_poses.h"
#include "scene_source.h"
#include "tabletop_perception/bop_metrics.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/pose_metrics.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::json;
using nlohmann::ordered_json;

namespace {

/// A scene with its truth; objects of the names in `unknown` are kept apart.
PosedScene readTruth(const fs::path& folder, const std::set<std::string>& unknown) {
  PosedScene scene;
  scene.name = folder.filename();
  scene.folder = folder;
  const fs::path file = folder / "gt.json";
  visitJson(file, [&](const json& content) {
    visitObjects(content, file, [&](const std::string& name, const json& object) {
      (unknown.count(name) > 0 ? scene.unknown : scene.truth).push_back(trueObjectFrom(object));
    });
  });
  return scene;
}

void readResult(const fs::path& file, PosedScene& scene) {
  scene.results = readResults(file);
  visitJson(file, [&](const json& content) {
    if (const auto times = content.find("times_ms"); times != content.end())
      scene.time_ms = times->at("total").get<double>();
  });
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

std::vector<double> lowestVertices(const std::vector<TrueObject>& truth,
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
std::vector<PosedScene> readScenes(const fs::path& truth, const std::set<std::string>& unknown) {
  checkFolder(truth, "--poses");
  std::set<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(truth))
    if (fs::exists(entry.path() / "gt.json")) folders.insert(entry.path());
  if (folders.empty())
    throw std::invalid_argument(
        "--poses must be a folder of folders with a gt.json, there is "
        "none in " +
        truth.string());
  std::vector<PosedScene> scenes;
  for (const auto& folder : folders) scenes.push_back(readTruth(folder, unknown));
  for (const auto& name : unknown)
    if (std::none_of(scenes.begin(), scenes.end(), [&](const PosedScene& scene) {
          return std::any_of(scene.unknown.begin(), scene.unknown.end(),
                             [&](const TrueObject& object) { return object.name == name; });
        }))
      throw std::invalid_argument("--unknown " + name + ": the truth has no object of that name");
  return scenes;
}

/// The models of all objects in the truth.
TrueModels readModels(const fs::path& folder, const std::vector<PosedScene>& scenes) {
  std::set<std::string> names;
  for (const auto& scene : scenes)
    for (const auto* objects : {&scene.truth, &scene.unknown})
      for (const auto& object : *objects) names.insert(object.name);
  return readTrueModels(folder, names);
}

/// Unknown objects that results with a name are nearest to, by the middles, of all true objects; a
/// result that is right has its object.
std::size_t countFalseAccepts(const PosedScene& scene, const TrueModels& models) {
  const auto squaredDistance = [&](const TrueObject& object, const NamedResult& result) {
    const auto& vertices = models.reference.at(object.name).vertices.points();
    return (object.T_camera_object * centroidOf(vertices).cast<double>() - result.middle)
        .squaredNorm();
  };
  std::set<std::size_t> accepted;
  for (std::size_t r = 0; r < scene.results.size(); ++r) {
    const auto& own = scene.score.object_of_result[r];
    if (own && scene.score.truth[*own].right()) continue;
    double nearest = std::numeric_limits<double>::max();
    for (const auto& object : scene.truth)
      nearest = std::min(nearest, squaredDistance(object, scene.results[r]));
    std::optional<std::size_t> stranger;
    for (std::size_t u = 0; u < scene.unknown.size(); ++u) {
      const double distance = squaredDistance(scene.unknown[u], scene.results[r]);
      if (distance >= nearest) continue;
      nearest = distance;
      stranger = u;
    }
    if (stranger) accepted.insert(*stranger);
  }
  return accepted.size();
}

bool isObject(const std::string& scene_and_name, const std::vector<PosedScene>& scenes) {
  for (const auto& scene : scenes)
    for (const auto& object : scene.truth)
      if (scene.name + "/" + object.name == scene_and_name) return true;
  return false;
}

/// Has ADD-S judge the objects of a scene that are named as SCENE/NAME.
void judgeByAddS(const std::vector<std::string>& names, PosedScene& scene) {
  for (auto& outcome : scene.score.truth)
    outcome.by_add_s =
        std::find(names.begin(), names.end(), scene.name + "/" + outcome.name) != names.end();
}

/// Takes out the objects that move or of which less is visible, and the results that are right
/// about them.
void leaveOutHidden(PosedScene& scene, double min_visible) {
  const auto hidden = [&](std::size_t object) {
    const TrueObject& one = scene.truth[object];
    return one.moving || one.visible.value_or(1) < min_visible;
  };
  PosedScene kept;
  std::vector<std::optional<std::size_t>> place(scene.truth.size());
  for (std::size_t i = 0; i < scene.truth.size(); ++i) {
    if (hidden(i)) continue;
    place[i] = kept.truth.size();
    kept.truth.push_back(scene.truth[i]);
    kept.score.truth.push_back(scene.score.truth[i]);
  }
  for (std::size_t r = 0; r < scene.results.size(); ++r) {
    const auto& object = scene.score.object_of_result[r];
    if (object && hidden(*object) && scene.right(r)) continue;
    kept.results.push_back(scene.results[r]);
    kept.score.object_of_result.push_back(object ? place[*object] : std::nullopt);
    ++kept.score.results[scene.results[r].name];
  }
  scene.truth = std::move(kept.truth);
  scene.results = std::move(kept.results);
  scene.score = std::move(kept.score);
}

/// None without a depth image.
std::optional<std::vector<std::optional<BopRecall>>> bopRecalls(const PosedScene& scene,
                                                                const TrueModels& models) {
  if (!fs::exists(scene.folder / "depth.png")) return std::nullopt;
  std::vector<std::optional<BopRecall>> recalls(scene.truth.size());
  visitScenes({scene.folder.string()}, "", [&](const Scene& seen) {
    const auto projection = fitProjection(seen.cloud);
    if (!projection)
      throw std::invalid_argument((scene.folder / "depth.png").string() + ": " + projection.reason);
    for (std::size_t r = 0; r < scene.results.size(); ++r) {
      const auto& object = scene.score.object_of_result[r];
      if (!object) continue;
      const auto& truth = scene.truth[*object];
      const auto& model = models.reference.at(truth.name);
      const auto error = measureBop(model, models.renderers.at(truth.name), seen.cloud, *projection,
                                    truth.T_camera_object, scene.results[r].T_camera_object);
      recalls[*object] = bopRecall(error, model.diameter);
    }
  });
  return recalls;
}

/// "-3.1 to 0.2" [mm]
std::string lowestText(const std::vector<double>& lowest) {
  if (lowest.empty()) return "no table";
  const auto [least, most] = std::minmax_element(lowest.begin(), lowest.end());
  return formatted(*least, 1000, 1) + " to " + formatted(*most, 1000, 1);
}

void printText(const std::vector<PosedScene>& scenes) {
  const auto scores = scoresOf(scenes);
  std::vector<std::vector<std::string>> rows;
  rows.push_back(poseHeads());
  rows.back().push_back("lowest above table mm");
  for (const auto& scene : scenes) {
    rows.push_back(poseRow(scene.name, summarize({scene.score})));
    rows.back().push_back(lowestText(scene.lowest));
  }
  rows.emplace_back();
  for (const auto& name : namesIn(scores))
    rows.push_back(poseRow(name, summarize(ofName(scores, name))));
  rows.emplace_back();
  rows.push_back(poseRow("all " + std::to_string(scenes.size()) + " scenes", summarize(scores)));
  printColumns(rows);
  const auto further = furtherRows(furtherFigures(scenes));
  if (!further.empty()) std::printf("\n");
  printColumns(further);
}

ordered_json furtherJson(const FurtherFigures& figures) {
  ordered_json json = {{"bop_recall", nullptr},
                       {"unknown", figures.unknown},
                       {"false_accepts", figures.false_accepts},
                       {"visibility", ordered_json::array()},
                       {"time_ms", orNull(figures.mean_time_ms)},
                       {"max_time_ms", orNull(figures.max_time_ms)}};
  if (figures.bop)
    json["bop_recall"] = {{"average", figures.bop->average()},
                          {"vsd", figures.bop->vsd},
                          {"mssd", figures.bop->mssd},
                          {"mspd", figures.bop->mspd}};
  for (const auto& bin : figures.visibility)
    json["visibility"].push_back(
        {{"from", bin.from}, {"to", bin.to}, {"objects", bin.objects}, {"right", bin.right}});
  return json;
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
          {"median_translation", orNull(summary.median_translation)},
          {"median_add_s", orNull(summary.median_add_s)},
          {"median_rotation", orNull(summary.median_rotation)}};
}

ordered_json outcomeJson(const PoseOutcome& outcome, std::optional<double> visible) {
  const auto figure = [&](double PoseError::*member) {
    return outcome.error ? ordered_json((*outcome.error).*member) : ordered_json();
  };
  return {{"name", outcome.name},
          {"right", outcome.right()},
          {"mssd", figure(&PoseError::mssd)},
          {"add_s", figure(&PoseError::add_s)},
          {"translation", figure(&PoseError::translation)},
          {"diameter", outcome.diameter},
          {"visible_share", orNull(visible)}};
}

ordered_json sceneJson(const PosedScene& scene) {
  ordered_json json = {{"scene", scene.name}, {"has_result", scene.has_result}};
  json.update(summaryJson(summarize({scene.score})));
  json["matches"] = ordered_json::array();
  for (std::size_t i = 0; i < scene.truth.size(); ++i)
    json["matches"].push_back(outcomeJson(scene.score.truth[i], scene.truth[i].visible));
  json["lowest_above_table"] = scene.lowest;  // in the order of the truth
  json["unknown"] = scene.unknown.size();
  json["false_accepts"] = scene.false_accepts;
  json["time_ms"] = orNull(scene.time_ms);
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
  json["all"].update(furtherJson(furtherFigures(scenes)));
  std::printf("%s\n", json.dump().c_str());
}

}  // namespace

FurtherFigures furtherFigures(const std::vector<PosedScene>& scenes) {
  constexpr int BINS = 5;
  FurtherFigures figures;
  std::vector<std::optional<BopRecall>> recalls;
  std::vector<FurtherFigures::Bin> bins(BINS);
  for (int b = 0; b < BINS; ++b) bins[b].from = b / 5.0, bins[b].to = (b + 1) / 5.0;
  bool any_visible = false;
  double sum = 0;
  std::size_t timed = 0;
  for (const auto& scene : scenes) {
    if (scene.bop) recalls.insert(recalls.end(), scene.bop->begin(), scene.bop->end());
    figures.unknown += scene.unknown.size();
    figures.false_accepts += scene.false_accepts;
    for (std::size_t i = 0; i < scene.truth.size(); ++i) {
      if (!scene.truth[i].visible) continue;
      any_visible = true;
      auto& bin = bins[std::clamp(static_cast<int>(*scene.truth[i].visible * BINS), 0, BINS - 1)];
      ++bin.objects;
      bin.right += scene.score.truth[i].right();
    }
    if (!scene.time_ms) continue;
    ++timed;
    sum += *scene.time_ms;
    figures.max_time_ms = std::max(figures.max_time_ms.value_or(0), *scene.time_ms);
  }
  figures.bop = meanRecall(recalls);
  if (any_visible) figures.visibility = bins;
  if (timed > 0) figures.mean_time_ms = sum / static_cast<double>(timed);
  return figures;
}

std::vector<PoseScore> scoresOf(const std::vector<PosedScene>& scenes) {
  std::vector<PoseScore> scores;
  for (const auto& scene : scenes) scores.push_back(scene.score);
  return scores;
}

std::vector<std::string> poseHeads() {
  return {"",        "right",      "right %",     "ADD-S %",  "AUC %",
          "named %", "of results", "precision %", "median mm"};
}

std::vector<std::string> poseRow(const std::string& name, const PoseSummary& summary) {
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

std::vector<std::vector<std::string>> furtherRows(const FurtherFigures& figures) {
  const auto percent = [](double share) { return formatted(share, 100, 1) + " %"; };
  std::vector<std::vector<std::string>> rows;
  if (figures.bop)
    rows.push_back({"BOP average recall, indicative", percent(figures.bop->average()), "VSD",
                    percent(figures.bop->vsd), "MSSD", percent(figures.bop->mssd), "MSPD",
                    percent(figures.bop->mspd)});
  if (figures.unknown > 0)
    rows.push_back({"unknown things given a name",
                    std::to_string(figures.false_accepts) + "/" + std::to_string(figures.unknown)});
  for (const auto& bin : figures.visibility)
    rows.push_back({"right where " + formatted(bin.from, 100, 0) + " to " +
                        formatted(bin.to, 100, 0) + " % are visible",
                    std::to_string(bin.right) + "/" + std::to_string(bin.objects)});
  if (figures.mean_time_ms)
    rows.push_back({"time per scene, mean and most", formatted(figures.mean_time_ms, 1, 1) + " ms",
                    formatted(figures.max_time_ms, 1, 1) + " ms"});
  return rows;
}

void evaluatePoses(const PoseEvaluation& evaluation) {
  std::optional<PoseReport> page;
  if (!evaluation.report.empty()) page.emplace(evaluation.report);
  auto scenes =
      readScenes(evaluation.truth, {evaluation.unknown.begin(), evaluation.unknown.end()});
  std::vector<std::string> names;
  for (const auto& scene : scenes) names.push_back(scene.name);
  for (const auto& name : evaluation.by_add_s)
    if (!isObject(name, scenes))
      throw std::invalid_argument("--by-add-s " + name + ": the truth has no such SCENE/NAME");
  const auto result_files = findResults(evaluation.results, names, ".json");
  const auto models = readModels(evaluation.models, scenes);
  for (auto& scene : scenes) {
    const auto result = result_files.find(scene.name);
    scene.has_result = result != result_files.end();
    if (scene.has_result) readResult(result->second, scene);
    scene.score = scorePoses({scene.truth.begin(), scene.truth.end()},
                             {scene.results.begin(), scene.results.end()}, models.reference);
    judgeByAddS(evaluation.by_add_s, scene);
    scene.false_accepts = countFalseAccepts(scene, models);
    leaveOutHidden(scene, evaluation.min_visible);
    scene.bop = bopRecalls(scene, models);
    if (!scene.has_result) continue;
    if (const auto plane = readTablePlane(result->second))
      scene.lowest = lowestVertices(scene.truth, models.reference, *plane);
  }
  if (evaluation.fit)
    printScoreFit(scenes, evaluation.json);
  else
    evaluation.json ? printJson(scenes) : printText(scenes);
  if (page) page->write(scenes, models);
}

}  // namespace tabletop_perception::tools
