#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/pipeline.h"

namespace CLI {
class App;
}

namespace tabletop_perception::tools {

/// What the commands that run the pipeline over scenes share on their command line.
struct SceneArguments {
  std::vector<std::string> scenes;  ///< as visitScenes takes them
  std::string topic;                ///< of bags; empty: the only one with clouds
  std::string config;               ///< yaml file with a section per stage; empty: defaults
  std::vector<double> up;           ///< three numbers, or none
  std::optional<double> pitch;      ///< of the camera below the horizon, instead of up [deg]
  bool json = false;                ///< one JSON object per scene and line instead of tables
};

/// Adds the options to a sub-command; `arguments` must outlive the parsing.
void addSceneArguments(CLI::App& command, SceneArguments& arguments);

/// The pipeline's options as --config says. Throws std::invalid_argument for a bad file.
PipelineOptions pipelineOptions(const SceneArguments& arguments);

/// The direction of --up or --pitch, unit length. Throws std::invalid_argument for a zero vector.
std::optional<Eigen::Vector3d> statedUp(const SceneArguments& arguments);

/// The models of a database. Throws std::invalid_argument when it cannot be read or holds none.
ModelIndex loadModels(const std::string& database);

/// Where a command writes one file per scene, named after it.
class OutputFolder {
 public:
  /// Makes the folder where there is none. Throws std::invalid_argument if that fails.
  explicit OutputFolder(std::filesystem::path folder);

  /// The file for a scene. Throws std::invalid_argument for the second scene of the same name,
  /// whose file would take the place of the first one's.
  std::filesystem::path fileFor(const std::string& scene_name, const std::string& extension);

 private:
  std::filesystem::path folder_;
  std::set<std::string> names_;
};

}  // namespace tabletop_perception::tools
