#include "evaluate.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <memory>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "commands.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

void checkFolder(const fs::path& folder, const std::string& option) {
  if (!fs::is_directory(folder))
    throw std::invalid_argument(option + " must be a folder, got '" + folder.string() + "'");
}

void visitJson(const fs::path& file,
               const std::function<void(const nlohmann::json& content)>& visit) {
  std::ifstream stream(file);
  if (!stream) throw std::invalid_argument("cannot read " + file.string());
  try {
    visit(nlohmann::json::parse(stream));
  } catch (const nlohmann::json::exception& error) {
    throw std::invalid_argument(file.string() + " cannot be understood: " + error.what());
  }
}

std::map<std::string, fs::path> findResults(const fs::path& results,
                                            const std::vector<std::string>& scenes,
                                            const std::string& extension) {
  std::map<std::string, fs::path> found;
  for (const auto& entry : fs::directory_iterator(results))
    if (entry.path().extension() == extension) found[entry.path().stem().string()] = entry.path();

  std::vector<std::string> missing;
  for (const auto& scene : scenes)
    if (found.count(scene) == 0) missing.push_back(scene);
  if (missing.size() == scenes.size())
    throw std::invalid_argument("no result for any of the " + std::to_string(scenes.size()) +
                                " scenes: looked for " +
                                (results / (scenes.front() + extension)).string() + " and so on");
  for (const auto& scene : missing)
    std::fprintf(stderr, "tabletop: no %s: scene %s counts as nothing found\n",
                 (results / (scene + extension)).c_str(), scene.c_str());
  for (auto entry = found.begin(); entry != found.end();) {
    if (std::find(scenes.begin(), scenes.end(), entry->first) != scenes.end()) {
      ++entry;
      continue;
    }
    std::fprintf(stderr, "tabletop: %s has no truth and does not count\n", entry->second.c_str());
    entry = found.erase(entry);
  }
  return found;
}

void printColumns(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  }
  for (const auto& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) {
      const int width = static_cast<int>(widths[c]);
      std::printf(c == 0 ? "%*s" : "  %*s", c == 0 ? -width : width, row[c].c_str());
    }
    std::printf("\n");
  }
}

std::string formatted(std::optional<double> value, double scale, int digits) {
  if (!value) return "-";
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", digits, *value * scale);
  return text;
}

nlohmann::ordered_json orNull(std::optional<double> value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json();
}

namespace {

struct EvaluateArguments {
  std::string labels, poses, picks, models, database, results, report, config;
  std::vector<std::string> unknown, by_add_s;
  double min_visible = 0;
  bool jitter = false, json = false, fit = false;
};

void evaluate(const EvaluateArguments& arguments) {
  if (!arguments.picks.empty()) {
    if (!arguments.database.empty() && arguments.models.empty())
      throw std::invalid_argument("--database with --picks needs --models, the objects' meshes");
    const auto options =
        arguments.config.empty() ? PipelineOptions() : readPipelineOptions(arguments.config);
    return evaluatePicks(
        {arguments.picks, arguments.models, arguments.database, options, arguments.json});
  }
  checkFolder(arguments.results, "--results");
  if (arguments.jitter)
    return evaluateJitter(arguments.results, arguments.database, arguments.json);
  if (!arguments.labels.empty())
    evaluateLabels(arguments.labels, arguments.results, arguments.json, arguments.report);
  else
    evaluatePoses({arguments.poses, arguments.models, arguments.results, arguments.unknown,
                   arguments.by_add_s, arguments.min_visible, arguments.json, arguments.fit,
                   arguments.report});
}

}  // namespace

void addEvaluate(CLI::App& app) {
  auto* command = app.add_subcommand("evaluate", "compare results with the truth");
  const auto arguments = std::make_shared<EvaluateArguments>();
  auto* truth = command->add_option_group("truth");
  auto* labels = truth->add_option(
      "--labels", arguments->labels,
      "folder of NAME.pcd with the truth as labels: 0 invalid, 1-9 table, 20-29 parts of object 1, "
      "30-39 of object 2 ...; gt_summary.json there may say the scenes' categories");
  auto* poses = truth->add_option("--poses", arguments->poses,
                                  "folder of NAME/gt.json with the truth as poses");
  auto* picks = truth->add_option(
      "--picks", arguments->picks,
      "folder of NAME.pcd with labels as above, or of NAME/ with gt.json and label.png (rendered "
      "from --models where it is missing): every object of 1,000 points and more is picked at five "
      "pixels");
  auto* jitter = truth->add_flag(
      "--jitter", arguments->jitter,
      "results are SCENE_FRAME.json of scenes in which nothing moves: how the poses do");
  truth->require_option(1);
  command
      ->add_option("--config", arguments->config,
                   "picks: yaml file with a section per stage (default: built-in values)")
      ->type_name("YAML")
      ->needs(picks);
  auto* models = command->add_option("--models", arguments->models,
                                     "folder of OBJECT/mesh.ply [m]; models_info.json there may "
                                     "say the objects' symmetries");
  poses->needs(models);
  models->excludes(labels);
  command
      ->add_option("--database", arguments->database,
                   "file of known objects; picks: every object whose visible share gt.json states "
                   "is picked and recognised; jitter: the symmetries by which poses are tracked")
      ->type_name("DB")
      ->excludes(labels)
      ->excludes(poses);
  command
      ->add_option("--unknown", arguments->unknown,
                   "objects of the truth that were not taught: giving them a name is wrong")
      ->type_name("NAME")
      ->needs(poses);
  command
      ->add_option("--by-add-s", arguments->by_add_s,
                   "objects whose pose cannot be told, a mug whose handle is hidden: ADD-S below "
                   "0.1 diameters makes them right")
      ->type_name("SCENE/NAME")
      ->needs(poses);
  command
      ->add_option("--min-visible", arguments->min_visible,
                   "objects of which a smaller share is visible need not be found (gt.json says)")
      ->type_name("SHARE")
      ->check(CLI::Range(0.0, 1.0))
      ->needs(poses);
  command
      ->add_flag("--fit", arguments->fit,
                 "print what the terms of the score should weigh for these results, which had to "
                 "be made with verify.min_score 0")
      ->needs(poses);
  auto* results = command->add_option(
      "--results", arguments->results,
      "folder of NAME.pcd from segment --output, or NAME.json from recognize --output");
  results->excludes(picks);
  labels->needs(results);
  poses->needs(results);
  jitter->needs(results);
  command->add_flag("--json", arguments->json, "print one JSON object (shares 0 to 1, metres)");
  command
      ->add_option("--report", arguments->report,
                   "write an HTML page with pictures of every scene to DIR/index.html; labels: "
                   "results without truth are shown too")
      ->type_name("DIR")
      ->excludes(picks)
      ->excludes(jitter);
  command->footer(
      "Labels: F, precision and recall of the points that matched segments and objects share, as\n"
      "means over scenes; objects matched with an IoU of at least 0.75, over all scenes; IoU of\n"
      "the table. An object in parts counts as a whole or in parts, whichever fits better.\n"
      "Poses: right is the right name and no vertex off by 0.1 diameters (MSSD, over symmetries);\n"
      "ADD-S counts below 0.1 diameters, its AUC goes to 10 cm; precision is right / results.\n"
      "With depth images also the BOP Challenge's average recall; with visible_share in gt.json\n"
      "the right ones by visibility.\n"
      "Picks: right where the points taken have an IoU of at least 0.5 with the object or with\n"
      "the part of it that was pointed at; of those, z within 5 deg of the main surface's normal\n"
      "and x within 10 deg of its longer side.\n"
      "Jitter: distances from each thing's mean position and mean rotation over the frames; a flip "
      "is\n"
      "a turn by over 30 deg from one sighting to the next; the same of what the tracker makes of "
      "them.\n"
      "Exit code: 0 done, 2 bad usage or unreadable input.\n"
      "Example: tabletop evaluate --labels truth --results segmented");
  command->callback([arguments] { evaluate(*arguments); });
}

}  // namespace tabletop_perception::tools
