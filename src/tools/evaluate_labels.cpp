#include "evaluate_labels.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "evaluate.h"
#include "report_labels.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

PcdContents readLabels(const fs::path& file) {
  auto contents = readPcd(file);
  if (contents.labels.empty())
    throw std::invalid_argument(file.string() + " must have a field `label`, it has none");
  return contents;
}

std::vector<std::string> categoriesOf(const std::vector<LabelledScene>& scenes) {
  std::vector<std::string> categories;
  for (const auto& scene : scenes)
    if (std::find(categories.begin(), categories.end(), scene.category) == categories.end())
      categories.push_back(scene.category);
  return categories;
}

LabelSummary summaryOf(const std::vector<LabelledScene>& scenes, const std::string& category) {
  std::vector<LabelScore> scores;
  for (const auto& scene : scenes)
    if (category.empty() || scene.category == category) scores.push_back(scene.score);
  return summarize(scores);
}

std::vector<std::string> figureHeads() {
  return {"[%]",   "F",     "prec",    "recall", "found",   "IoU75",
          "table", "worst", "F whole", "IoU75",  "F parts", "IoU75"};
}

std::vector<std::string> figureRow(const std::string& name, const LabelSummary& summary) {
  const auto& best = summary.best;
  const auto percent = [](std::optional<double> share) { return formatted(share, 100, 1); };
  return {name,
          percent(best.f),
          percent(best.precision),
          percent(best.recall),
          std::to_string(best.found) + "/" + std::to_string(best.objects),
          percent(best.foundShare()),
          percent(summary.table_iou),
          percent(summary.worst_table_iou),
          percent(summary.whole.f),
          percent(summary.whole.foundShare()),
          percent(summary.parts.f),
          percent(summary.parts.foundShare())};
}

namespace {

using Categories = std::vector<std::pair<std::string, std::string>>;

/// The scenes' names and categories in the order of gt_summary.json; none without the file.
Categories readCategories(const fs::path& truth) {
  Categories categories;
  const fs::path file = truth / "gt_summary.json";
  if (!fs::exists(file)) return categories;
  visitJson(file, [&](const auto& content) {
    for (const auto& scene : content.at("scenes"))
      categories.emplace_back(fs::path(scene.at("file").template get<std::string>()).stem(),
                              scene.at("category").template get<std::string>());
  });
  return categories;
}

/// The .pcd files of a folder by name.
std::map<std::string, fs::path> pcdFiles(const fs::path& folder) {
  std::map<std::string, fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".pcd") files[entry.path().stem()] = entry.path();
  return files;
}

/// The results of scenes that are not among `names`.
std::map<std::string, fs::path> resultsWithoutTruth(const fs::path& results,
                                                    const std::vector<std::string>& names) {
  auto files = pcdFiles(results);
  for (const auto& name : names) files.erase(name);
  return files;
}

}  // namespace

std::vector<LabelledScene> labelledScenes(const fs::path& truth, const std::string& option) {
  checkFolder(truth, option);
  auto files = pcdFiles(truth);
  if (files.empty())
    throw std::invalid_argument(option + " must be a folder of .pcd files, there is none in " +
                                truth.string());

  std::vector<LabelledScene> scenes;
  const auto categories = readCategories(truth);
  for (const auto& [name, category] : categories) {
    const auto file = files.find(name);
    if (file == files.end()) continue;
    scenes.push_back({name, category, file->second, {}, {}});
    files.erase(file);
  }
  for (const auto& [name, file] : files)
    scenes.push_back({name, categories.empty() ? "all" : "other", file, {}, {}});
  return scenes;
}

namespace {

std::string sizeOf(const Cloud& cloud) {
  return std::to_string(cloud.width) + " x " + std::to_string(cloud.height);
}

LabelScore scoreFiles(const fs::path& truth_file, const fs::path& result_file) {
  const auto truth = readLabels(truth_file), result = readLabels(result_file);
  if (truth.cloud.width != result.cloud.width || truth.cloud.height != result.cloud.height)
    throw std::invalid_argument(result_file.string() + " must have the size of its truth, " +
                                sizeOf(truth.cloud) + ", got " + sizeOf(result.cloud));
  return scoreLabels(truth.labels, result.labels);
}

LabelScore scoreWithoutResult(const fs::path& truth_file) {
  const auto truth = readLabels(truth_file).labels;
  return scoreLabels(truth, std::vector<std::uint32_t>(truth.size(), 0));
}

void printText(const std::vector<LabelledScene>& scenes) {
  std::vector<std::vector<std::string>> rows;
  rows.push_back(figureHeads());
  for (const auto& scene : scenes) rows.push_back(figureRow(scene.name, summarize({scene.score})));
  rows.emplace_back();
  for (const auto& category : categoriesOf(scenes)) {
    const auto summary = summaryOf(scenes, category);
    rows.push_back(figureRow(category + " (" + std::to_string(summary.scenes) + ")", summary));
  }
  rows.emplace_back();
  rows.push_back(
      figureRow("all " + std::to_string(scenes.size()) + " scenes", summaryOf(scenes, "")));
  printColumns(rows);
}

ordered_json overlapJson(const OverlapSummary& overlap) {
  return {{"f", overlap.f},           {"precision", overlap.precision},
          {"recall", overlap.recall}, {"objects", overlap.objects},
          {"found", overlap.found},   {"recall_iou_75", orNull(overlap.foundShare())}};
}

ordered_json summaryJson(const LabelSummary& summary) {
  auto json = overlapJson(summary.best);
  json["table_iou"] = summary.table_iou;
  json["worst_table_iou"] = summary.worst_table_iou;
  json["whole"] = overlapJson(summary.whole);
  json["parts"] = overlapJson(summary.parts);
  return json;
}

ordered_json objectJson(const ObjectOverlap& object) {
  return {{"object", object.object},
          {"part", object.part == 0 ? ordered_json() : ordered_json(object.part)},
          {"points", object.points},
          {"label", object.segment == 0 ? ordered_json() : ordered_json(object.segment)},
          {"label_points", object.segment_points},
          {"overlap", object.overlap},
          {"iou", object.iou()}};
}

ordered_json sceneJson(const LabelledScene& scene) {
  ordered_json json = {
      {"scene", scene.name}, {"category", scene.category}, {"has_result", !scene.result.empty()}};
  json.update(summaryJson(summarize({scene.score})));
  json["matches"] = ordered_json::array();
  for (const auto& object : scene.score.best.objects) json["matches"].push_back(objectJson(object));
  return json;
}

void printJson(const std::vector<LabelledScene>& scenes) {
  ordered_json json = {{"scenes", ordered_json::array()}, {"categories", ordered_json::array()}};
  for (const auto& scene : scenes) json["scenes"].push_back(sceneJson(scene));
  for (const auto& category : categoriesOf(scenes)) {
    const auto summary = summaryOf(scenes, category);
    json["categories"].push_back({{"category", category}, {"scenes", summary.scenes}});
    json["categories"].back().update(summaryJson(summary));
  }
  json["all"] = {{"scenes", scenes.size()}};
  json["all"].update(summaryJson(summaryOf(scenes, "")));
  std::printf("%s\n", json.dump().c_str());
}

}  // namespace

void evaluateLabels(const fs::path& truth, const fs::path& results, bool json,
                    const fs::path& report) {
  auto scenes = labelledScenes(truth, "--labels");
  std::optional<LabelReport> page;
  if (!report.empty()) page.emplace(report);
  std::vector<std::string> names;
  for (const auto& scene : scenes) names.push_back(scene.name);
  const auto result_files = findResults(results, names, ".pcd");
  for (auto& scene : scenes) {
    const auto result = result_files.find(scene.name);
    if (result != result_files.end()) scene.result = result->second;
    scene.score = scene.result.empty() ? scoreWithoutResult(scene.truth)
                                       : scoreFiles(scene.truth, scene.result);
  }
  json ? printJson(scenes) : printText(scenes);
  if (page) page->write(scenes, resultsWithoutTruth(results, names));
}

}  // namespace tabletop_perception::tools
