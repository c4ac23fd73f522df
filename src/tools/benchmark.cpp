#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "benchmark_stages.h"
#include "commands.h"
#include "scene_arguments.h"
#include "scene_source.h"

namespace tabletop_perception::tools {
namespace {

using nlohmann::json;

struct BenchmarkArguments : SceneArguments {
  std::string database;  ///< empty: recognition is not timed
  int runs = 20;
};

json timingJson(const Timing& timing) {
  return {{"ours_ms", timing.min_ms}, {"ours_median_ms", timing.median_ms}};
}

json stageJson(const StageTiming& stage) {
  json object = timingJson(stage.ours);
  object.update({{"name", stage.name},
                 {"stock", stage.stock},
                 {"runs", stage.ours.runs},
                 {"pcl_ms", stage.pcl.min_ms},
                 {"pcl_median_ms", stage.pcl.median_ms},
                 {"pcl_runs", stage.pcl.runs},
                 {"ratio", stage.ratio()}});
  if (stage.rebuilt)
    object.update({{"rebuilt_ms", stage.rebuilt->min_ms},
                   {"rebuilt_median_ms", stage.rebuilt->median_ms},
                   {"rebuilt_ratio", stage.rebuilt->min_ms / stage.ours.min_ms}});
  return object;
}

json normalsJson(const NormalsQuality& quality) {
  return {{"valid_share", quality.valid_share},
          {"median_error_deg", quality.median_error_deg},
          {"p95_error_deg", quality.p95_error_deg}};
}

json normalsMethodJson(const NormalsTiming& entry) {
  json object = timingJson(entry.ours);
  object.update({{"method", entry.method}, {"ours", normalsJson(entry.our_quality)}});
  if (entry.pcl && entry.pcl_quality)
    object.update({{"pcl_ms", entry.pcl->min_ms},
                   {"pcl_median_ms", entry.pcl->median_ms},
                   {"pcl", normalsJson(*entry.pcl_quality)}});
  return object;
}

json sceneJson(const SceneTiming& timing) {
  json object = {{"scene", timing.scene},
                 {"stages", json::array()},
                 {"reason", timing.reason.empty() ? json() : json(timing.reason)},
                 {"memory", {{"process_peak_mb", timing.process_peak_mb}}}};
  for (const auto& stage : timing.stages) object["stages"].push_back(stageJson(stage));
  if (timing.frame_mb) object["memory"]["frame_mb"] = *timing.frame_mb;
  if (timing.table) object["table"] = timingJson(*timing.table);
  if (timing.split) object["split"] = timingJson(*timing.split);
  if (timing.recognition) object["recognition"] = timingJson(*timing.recognition);
  if (timing.our_normals && timing.pcl_normals)
    object["normals"] = {{"ours", normalsJson(*timing.our_normals)},
                         {"pcl", normalsJson(*timing.pcl_normals)}};
  for (const auto& entry : timing.normals_methods)
    object["normals_methods"].push_back(normalsMethodJson(entry));
  return object;
}

const StageTiming* findStage(const SceneTiming& timing, const std::string& name) {
  const auto stage = std::find_if(timing.stages.begin(), timing.stages.end(),
                                  [&](const StageTiming& other) { return other.name == name; });
  return stage == timing.stages.end() ? nullptr : &*stage;
}

void printOwn(const char* name, const Timing& timing, const std::string& note) {
  std::printf("  %-18s %8.2f %8.2f  %s\n", name, timing.min_ms, timing.median_ms, note.c_str());
}

void printNormals(const char* whose, const NormalsQuality& quality) {
  std::printf("  normals, %s: %.1f %% of the points have one, 95 %% on the table within %.1f deg\n",
              whose, quality.valid_share * 100, quality.p95_error_deg);
}

void printQuality(const Timing& timing, const NormalsQuality& quality) {
  std::printf(" %8.2f %5.1f %% %5.1f %5.1f", timing.min_ms, quality.valid_share * 100,
              quality.median_error_deg, quality.p95_error_deg);
}

void printNormalsMethods(const std::vector<NormalsTiming>& methods) {
  if (methods.empty()) return;
  std::printf("  %-20s %28s %28s\n", "normals [ms, deg]", "ours   valid median   p95",
              "PCL   valid median   p95");
  for (const auto& entry : methods) {
    std::printf("  %-20s", entry.method.c_str());
    printQuality(entry.ours, entry.our_quality);
    if (entry.pcl && entry.pcl_quality) printQuality(*entry.pcl, *entry.pcl_quality);
    std::printf("\n");
  }
}

void printScene(const SceneTiming& timing) {
  std::printf("%s\n  %-18s %17s %17s  ratio\n", timing.scene.c_str(), "[ms]", "ours min  median",
              "PCL min  median");
  for (const auto& stage : timing.stages) {
    std::printf("  %-18s %8.2f %8.2f %8.2f %8.2f %6.1f  %s", stage.name.c_str(), stage.ours.min_ms,
                stage.ours.median_ms, stage.pcl.min_ms, stage.pcl.median_ms, stage.ratio(),
                stage.stock.c_str());
    if (stage.pcl.runs < stage.ours.runs) std::printf(" (%d runs)", stage.pcl.runs);
    if (stage.rebuilt)
      std::printf("; rebuilt %.2f, ratio %.1f", stage.rebuilt->min_ms,
                  stage.rebuilt->min_ms / stage.ours.min_ms);
    std::printf("\n");
  }
  if (timing.table) printOwn("table", *timing.table, "with outline and points, in the front end");
  if (timing.split) {
    char share[80];
    const auto* front_end = findStage(timing, "front_end");
    std::snprintf(share, sizeof share, "beside the front end's %.2f",
                  front_end ? front_end->ours.min_ms : 0.0);
    printOwn("split", *timing.split, share);
  }
  if (timing.recognition) printOwn("recognition", *timing.recognition, "cloud to poses");
  if (timing.our_normals) printNormals("ours", *timing.our_normals);
  if (timing.pcl_normals) printNormals("PCL", *timing.pcl_normals);
  printNormalsMethods(timing.normals_methods);
  if (timing.frame_mb) std::printf("  memory: %.1f MB for a frame,", *timing.frame_mb);
  std::printf(" process peak %.0f MB\n", timing.process_peak_mb);
  if (!timing.reason.empty()) std::printf("  reason: %s\n", timing.reason.c_str());
}

/// The least ratio of each stage over all scenes, in the order of the stages.
class WorstRatios {
 public:
  void add(const SceneTiming& timing) {
    for (const auto& stage : timing.stages) {
      const auto known = std::find_if(worst_.begin(), worst_.end(),
                                      [&](const auto& entry) { return entry.first == stage.name; });
      if (known == worst_.end())
        worst_.emplace_back(stage.name, stage.ratio());
      else
        known->second = std::min(known->second, stage.ratio());
    }
  }

  void print() const {
    std::printf("worst ratios:");
    for (const auto& [name, ratio] : worst_) std::printf(" %s %.1f", name.c_str(), ratio);
    std::printf("\n");
  }

 private:
  std::vector<std::pair<std::string, double>> worst_;
};

void benchmark(const BenchmarkArguments& arguments) {
  const auto options = pipelineOptions(arguments);
  const auto stated_up = statedUp(arguments);
  std::optional<ModelIndex> models;
  if (!arguments.database.empty()) models.emplace(loadModels(arguments.database));
  if (!arguments.json)
    std::printf("one thread, minimum and median of %d runs in turn with stock PCL's\n",
                arguments.runs);

  WorstRatios worst;
  visitScenes(arguments.scenes, arguments.topic, [&](const Scene& scene) {
    const auto timing = benchmarkScene(scene, stated_up ? stated_up : scene.up, options,
                                       models ? &*models : nullptr, arguments.runs);
    worst.add(timing);
    if (arguments.json)
      std::printf("%s\n", sceneJson(timing).dump().c_str());
    else
      printScene(timing);
    std::fflush(stdout);
  });
  if (!arguments.json) worst.print();
}

}  // namespace

void addBenchmark(CLI::App& app) {
  auto* command = app.add_subcommand("benchmark", "time every stage side by side with stock PCL");
  const auto arguments = std::make_shared<BenchmarkArguments>();
  addSceneArguments(*command, *arguments);
  command
      ->add_option("--database", arguments->database,
                   "time recognition too, with the objects of this file")
      ->type_name("DB");
  command->add_option("--runs", arguments->runs, "of each stage (default: 20)")
      ->check(CLI::PositiveNumber)
      ->type_name("N");
  command->footer(
      "Times in milliseconds, lengths in metres; ratio: PCL's minimum over ours. See "
      "docs/performance.md.\n"
      "Exit code: 0 done, 2 bad usage or unreadable input.\n"
      "Example: tabletop benchmark scene.pcd --json");
  command->callback([arguments] { benchmark(*arguments); });
}

}  // namespace tabletop_perception::tools
