#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "result_json.h"
#include "result_text.h"
#include "scene_arguments.h"
#include "scene_source.h"
#include "tabletop_perception/pick_scene.h"

namespace tabletop_perception::tools {
namespace {

struct PickArguments : SceneArguments {
  std::vector<double> pixel;  ///< column and row, or none
  std::vector<double> point;  ///< in the scene's own frame [m], or none
  std::string database;       ///< empty: nothing is recognised
  std::string model;          ///< name of the only object that counts; empty: all
};

/// The models that a thing is compared with.
ModelIndex modelsFor(const PickArguments& arguments) {
  ModelIndex all = loadModels(arguments.database);
  if (arguments.model.empty()) return all;
  const int model = all.find(arguments.model);
  if (model < 0)
    throw std::invalid_argument(arguments.database + " holds no object '" + arguments.model + "'");
  return ModelIndex({all.models()[model]});
}

/// Where the arguments point in a scene, in the camera's frame.
Found<Eigen::Vector3f> targetIn(const Scene& scene, const PickArguments& arguments,
                                const PickOptions& options) {
  if (!arguments.pixel.empty())
    return pointAtPixel(scene.cloud, {arguments.pixel[0], arguments.pixel[1]},
                        options.pixel_window);
  const Eigen::Vector3d point(arguments.point[0], arguments.point[1], arguments.point[2]);
  return Eigen::Vector3f((point - scene.sensor).cast<float>());
}

void pick(const PickArguments& arguments) {
  if (arguments.scenes.size() != 1)
    throw std::invalid_argument("pick takes one SCENE, got " +
                                std::to_string(arguments.scenes.size()));
  const auto options = pipelineOptions(arguments);
  const auto stated_up = statedUp(arguments);
  std::optional<ModelIndex> models;
  if (!arguments.database.empty()) models.emplace(modelsFor(arguments));

  bool any = false;
  visitScenes(arguments.scenes, arguments.topic, [&](const Scene& scene) {
    const auto target = targetIn(scene, arguments, options.pick);
    auto picked = target
                      ? pickInScene(scene.cloud, *target, stated_up ? stated_up : scene.up, options)
                      : Found<Pick>::none(target.reason);
    if (picked)
      *picked.value =
          atFullResolution(filterCloud(scene.cloud, options.filter), std::move(*picked.value));
    std::optional<SceneObject> object;
    std::vector<PlacedGrasp> grasps;
    if (picked && models) {
      object = recognizePick(*picked.value, *models, options);
      if (const int model = models->find(object->name); model >= 0)
        completePick(*picked.value, models->models()[model], object->T_camera_object,
                     options.grasp);
      grasps = graspsOf(*object, {picked->table}, *models, options.grasp);
    }
    if (arguments.json)
      std::fputs(jsonLine(pickJson(scene, picked, object, grasps)).c_str(), stdout);
    else
      printPick(scene, picked, object, grasps);
    std::fflush(stdout);
    if (picked) printTimeTable(picked->times_ms, arguments.json ? stderr : stdout);
    any = any || picked;
  });
  if (!any) throw CommandFailed{1};
}

}  // namespace

void addPick(CLI::App& app) {
  auto* command = app.add_subcommand("pick", "the pose of the thing at a pixel or a point");
  const auto arguments = std::make_shared<PickArguments>();
  addSceneArguments(*command, *arguments);
  auto* where = command->add_option_group("where");
  where->add_option("--pixel", arguments->pixel, "column and row in the scene's cloud")
      ->type_size(2)
      ->expected(1)
      ->type_name("U V");
  where->add_option("--point", arguments->point, "in the scene's frame [m]")
      ->type_size(3)
      ->expected(1)
      ->type_name("X Y Z");
  where->require_option(1);
  auto* database = command
                       ->add_option("--database", arguments->database,
                                    "file that `tabletop train` wrote: say what the thing is, too")
                       ->type_name("DB");
  command->add_option("--model", arguments->model, "the only object of the database that counts")
      ->type_name("NAME")
      ->needs(database);
  command->footer(
      "The frame lies behind the middle of the thing's largest visible surface: z out of it\n"
      "towards the camera, x along its longer side. The times of the stages go to stderr with "
      "--json.\n"
      "Exit code: 0 done, 1 nothing there, 2 bad usage or unreadable input.\n"
      "Example: tabletop pick scene.pcd --pixel 320 240 --json");
  command->callback([arguments] { pick(*arguments); });
}

}  // namespace tabletop_perception::tools
