#include "scene_arguments.h"

#include <stdexcept>
#include <utility>

#include <CLI/CLI.hpp>

#include "tabletop_perception/database.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

void addSceneArguments(CLI::App& command, SceneArguments& arguments) {
  command
      .add_option("SCENE", arguments.scenes,
                  "a .pcd, a .bag, or a folder with depth.png and gt.json or camera.json")
      ->type_name("")
      ->required();
  command.add_option("--topic", arguments.topic,
                     "sensor_msgs/PointCloud2 topic of a bag (default: its only one)");
  command
      .add_option("--config", arguments.config,
                  "yaml file with a section per stage (default: built-in values)")
      ->type_name("YAML");
  auto* up =
      command.add_option("--up", arguments.up, "direction against gravity in the cloud's frame")
          ->type_size(3)
          ->expected(1)
          ->type_name("X Y Z");
  command
      .add_option("--pitch", arguments.pitch,
                  "instead: angle by which a level camera with an optical frame looks below the "
                  "horizon [deg]")
      ->check(CLI::Range(-90.0, 90.0))
      ->type_name("DEG")
      ->excludes(up);
  command.add_flag("--json", arguments.json,
                   "print one JSON object per scene and line [metres, seconds, times in ms]");
}

PipelineOptions pipelineOptions(const SceneArguments& arguments) {
  return arguments.config.empty() ? PipelineOptions() : readPipelineOptions(arguments.config);
}

std::optional<Eigen::Vector3d> statedUp(const SceneArguments& arguments) {
  if (arguments.pitch) return upOfPitch(*arguments.pitch);
  if (arguments.up.empty()) return std::nullopt;
  const Eigen::Vector3d up(arguments.up[0], arguments.up[1], arguments.up[2]);
  if (!up.allFinite() || up.isZero())
    throw std::invalid_argument("--up must be a direction, three numbers that are not all zero");
  return up.normalized();
}

ModelIndex loadModels(const std::string& database) {
  ModelIndex models(ObjectDatabase(database, ObjectDatabase::Mode::READ));
  if (models.empty())
    throw std::invalid_argument(database +
                                ": no object in the database; `tabletop train` adds one");
  return models;
}

OutputFolder::OutputFolder(fs::path folder) : folder_(std::move(folder)) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (!fs::is_directory(folder_))
    throw std::invalid_argument("--output " + folder_.string() + " cannot be made a folder" +
                                (error ? ": " + error.message() : ""));
}

fs::path OutputFolder::fileFor(const std::string& scene_name, const std::string& extension) {
  if (!names_.insert(scene_name).second)
    throw std::invalid_argument("two scenes are named " + scene_name + ": the second would take " +
                                "the place of the first in " + folder_.string());
  return folder_ / (scene_name + extension);
}

}  // namespace tabletop_perception::tools
