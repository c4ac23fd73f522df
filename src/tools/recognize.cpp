#include <algorithm>
#include <cstdio>
#include <fstream>
#include <memory>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "result_json.h"
#include "result_text.h"
#include "scene_arguments.h"
#include "scene_source.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

namespace {

struct RecognizeArguments : SceneArguments {
  std::string database;
  std::string output;  ///< a folder of NAME.json; empty: nothing is written
};

void writeText(const fs::path& file, const std::string& text) {
  std::ofstream stream(file);
  stream << text << std::flush;
  if (!stream) throw std::runtime_error(file.string() + ": cannot be written");
}

bool anyKnown(const std::vector<SceneObject>& objects) {
  return std::any_of(objects.begin(), objects.end(),
                     [](const SceneObject& object) { return object.name != "unknown"; });
}

void recognize(const RecognizeArguments& arguments) {
  const auto options = pipelineOptions(arguments);
  const auto stated_up = statedUp(arguments);
  const auto models = loadModels(arguments.database);
  std::optional<OutputFolder> folder;
  if (!arguments.output.empty()) folder.emplace(arguments.output);

  bool any_known = false;
  visitScenes(arguments.scenes, arguments.topic, [&](const Scene& scene) {
    const auto up = stated_up ? stated_up : scene.up;
    const auto recognition = recognizeScene(scene.cloud, up, models, options);
    const auto line = jsonLine(recognitionJson(scene, recognition));
    if (folder) writeText(folder->fileFor(scene.name, ".json"), line);
    if (arguments.json)
      std::fputs(line.c_str(), stdout);
    else
      printRecognition(scene, recognition, up);
    std::fflush(stdout);
    any_known = any_known || anyKnown(recognition.objects);
  });
  if (!any_known) throw CommandFailed{1};
}

}  // namespace

void addRecognize(CLI::App& app) {
  auto* command = app.add_subcommand("recognize", "name the things on the table, with 6D poses");
  const auto arguments = std::make_shared<RecognizeArguments>();
  addSceneArguments(*command, *arguments);
  command->add_option("--database", arguments->database, "file that `tabletop train` wrote")
      ->type_name("DB")
      ->required();
  command->add_option("--output", arguments->output, "folder for the JSON of each scene, NAME.json")
      ->type_name("DIR");
  command->footer(
      "Poses map the model's own frame into the cloud's frame, in metres.\n"
      "Exit code: 0 done, 1 no scene had a known object, 2 bad usage or unreadable input.\n"
      "Example: tabletop recognize scene.pcd --database objects.db --json");
  command->callback([arguments] { recognize(*arguments); });
}

}  // namespace tabletop_perception::tools
