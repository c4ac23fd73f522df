#include "tabletop_perception/train.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "progress.h"
#include "scene_arguments.h"
#include "scene_source.h"
#include "symmetry_text.h"
#include "tabletop_perception/database.h"
#include "tabletop_perception/mesh.h"
#include "tabletop_perception/pcd.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/symmetry.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

namespace {

struct TrainArguments : SceneArguments {  // of which `json` is not used
  std::string database, name;
  std::string mesh;
  std::string unit = "m";
  MeshViewOptions mesh_views;
  std::vector<std::string> clouds;
  std::string views;  ///< a folder of clouds
  std::vector<std::string> symmetry;
};

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

/// The middle of the box about a surface [m].
Eigen::Vector3d middleOf(const Surface& surface) {
  Eigen::AlignedBox3f box;
  for (const auto& p : surface.points) box.extend(p);
  return box.center().cast<double>();
}

// --- where views come from

/// A cloud whose points lie in the object's frame and whose VIEWPOINT is the camera's pose in it.
TrainingView viewOf(const PcdContents& contents) {
  TrainingView view{contents.cloud, contents.T_data_sensor.inverse()};
  const Eigen::Isometry3f T_view_object = view.T_view_object.cast<float>();
  for (const int i : validIndices(view.cloud))
    view.cloud.setPoint(i, T_view_object * contents.cloud.point(i));
  return view;
}

/// The object's frame may be that of one camera, not of two.
void checkPoses(const std::vector<std::string>& files, const std::vector<TrainingView>& views) {
  std::vector<std::string> without;
  for (std::size_t i = 0; i < views.size(); ++i)
    if (views[i].T_view_object.isApprox(Eigen::Isometry3d::Identity())) without.push_back(files[i]);
  if (without.size() > 1)
    throw std::invalid_argument(
        std::to_string(without.size()) + " of " + std::to_string(files.size()) +
        " views without poses (" + without[0] + ", " + without[1] +
        "): VIEWPOINT of each must be the camera's pose in the object's frame");
}

std::vector<TrainingView> readViews(const std::vector<std::string>& files) {
  std::vector<TrainingView> views;
  for (const auto& file : files) {
    views.push_back(viewOf(readPcd(file)));
    if (validIndices(views.back().cloud).empty())
      throw std::invalid_argument(file + ": the cloud has no points");
  }
  checkPoses(files, views);
  return views;
}

/// The view clouds of a folder by name; model.pcd is the whole surface, which no camera saw.
std::vector<std::string> viewFilesIn(const std::string& folder) {
  if (!fs::is_directory(folder)) throw std::invalid_argument(folder + " is not a folder");
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".pcd" && entry.path().filename() != "model.pcd")
      files.push_back(entry.path().string());
  if (files.empty()) throw std::invalid_argument(folder + " holds no view, a .pcd each");
  std::sort(files.begin(), files.end());
  return files;
}

/// The only thing on the table of a scene, in the frame of the scene's file.
TrainingView loneObject(const Scene& scene, const std::optional<Eigen::Vector3d>& up,
                        PipelineOptions options) {
  options.split.enabled = false;  // what stands alone is one thing, hollows or not
  options.color.split = false;
  const auto segmentation = segmentScene(scene.cloud, up, options);
  if (segmentation.clusters.empty())
    throw std::invalid_argument(scene.name + ": nothing to learn: " + segmentation.reason);
  if (segmentation.clusters.size() > 1)
    throw std::invalid_argument(scene.name + ": " + std::to_string(segmentation.clusters.size()) +
                                " things stand on the table, the object must be alone there");
  TrainingView view{selectPoints(segmentation.filtered, segmentation.clusters[0]),
                    Eigen::Isometry3d::Identity()};
  view.T_view_object.translation() = -scene.sensor;
  return view;
}

TrainingView readLoneObject(const TrainArguments& arguments) {
  if (arguments.scenes.size() > 1)
    throw std::invalid_argument("--scene takes one scene, got " +
                                std::to_string(arguments.scenes.size()) +
                                ": without the camera's poses they do not join to one object");
  const auto options = pipelineOptions(arguments);
  const auto stated_up = statedUp(arguments);
  std::optional<TrainingView> view;
  int scenes = 0;
  visitScenes(arguments.scenes, arguments.topic, [&](const Scene& scene) {
    if (++scenes == 1) view = loneObject(scene, stated_up ? stated_up : scene.up, options);
  });
  if (!view) throw std::invalid_argument(arguments.scenes[0] + ": no cloud in it");
  if (scenes > 1)
    std::fprintf(stderr, "%s: the first of %d clouds is taken\n", arguments.scenes[0].c_str(),
                 scenes);
  return *view;
}

// --- the work

ObjectModel trainAsTold(const TrainArguments& arguments) {
  const DescriptorOptions options;
  const auto train = [&](const auto& from, const auto& source, const std::string& origin) {
    ProgressBar bar("training " + arguments.name);
    auto model = from(arguments.name, source, options, [&](double done) { bar.show(done); });
    model.origin = origin;
    return model;
  };
  const auto fileName = [](const std::string& path) { return fs::path(path).filename().string(); };

  if (!arguments.mesh.empty()) {
    const Mesh mesh = readMesh(arguments.mesh, arguments.unit == "mm" ? 0.001 : 1);
    const auto look = [&](const auto&... what) {
      return trainFromMesh(what..., arguments.mesh_views);
    };
    auto model = train(look, mesh, "mesh " + fileName(arguments.mesh));
    if (!mesh.unread_texture.empty())
      std::fprintf(stderr, "%s: cannot be read as an image, %s stays without its colours\n",
                   mesh.unread_texture.c_str(), arguments.name.c_str());
    if (const auto open = countOpenEdges(mesh))
      std::fprintf(stderr, "%s: %zu open edges; where it has no surface the object is not known\n",
                   arguments.mesh.c_str(), open);
    return model;
  }
  if (!arguments.scenes.empty())
    return train(trainFromViews, std::vector<TrainingView>{readLoneObject(arguments)},
                 "scene " + fileName(arguments.scenes[0]));
  const auto files = arguments.views.empty() ? arguments.clouds : viewFilesIn(arguments.views);
  return train(
      trainFromViews, readViews(files),
      files.size() == 1 ? "cloud " + fileName(files[0]) : std::to_string(files.size()) + " clouds");
}

/// What stays of an object that is trained anew: its grasps belong to the thing, not to its views.
std::vector<StoredGrasp> graspsOf(const std::string& name, const ObjectDatabase& database) {
  const auto names = database.names();
  if (std::find(names.begin(), names.end(), name) == names.end()) return {};
  auto grasps = database.load(name).grasps;
  if (!grasps.empty())
    std::fprintf(stderr, "%s keeps its %zu stored grasp%s\n", name.c_str(), grasps.size(),
                 grasps.size() == 1 ? "" : "s");
  return grasps;
}

void train(const TrainArguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  // What would fail at the end is refused at once.
  checkObjectName(arguments.name);
  checkMeshViews(arguments.mesh_views);
  const auto symmetry = joined(arguments.symmetry);
  if (!symmetry.empty()) declaredSymmetry(symmetry, Eigen::Vector3d::Zero());
  if (!fs::is_directory(fs::absolute(arguments.database).parent_path()))
    throw std::invalid_argument(arguments.database + ": its folder does not exist");
  if (fs::exists(arguments.database))
    ObjectDatabase(arguments.database, ObjectDatabase::Mode::READ);

  auto model = trainAsTold(arguments);
  if (!symmetry.empty()) model.symmetry = declaredSymmetry(symmetry, middleOf(model.surface));
  ObjectDatabase database(arguments.database, ObjectDatabase::Mode::WRITE);
  model.grasps = graspsOf(model.name, database);
  database.store(model);

  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
  std::printf("%s: %zu view%s, diameter %.0f mm, symmetry %s, %.1f s\n", model.name.c_str(),
              model.views.size(), model.views.size() == 1 ? "" : "s", model.diameter * 1000,
              symmetryWords(model.symmetry).c_str(), passed.count());
}

std::string notEmpty(const std::string& argument) {
  return argument.empty() ? "must not be empty" : "";
}

}  // namespace

void addTrain(CLI::App& app) {
  auto* command = app.add_subcommand("train", "learn an object, or learn it anew");
  const auto arguments = std::make_shared<TrainArguments>();
  command->add_option("--database", arguments->database, "the file of known objects")
      ->required()
      ->check(notEmpty)
      ->type_name("DB");
  command->add_option("--name", arguments->name, "of the object: letters, digits, '_' and '-'")
      ->required()
      ->type_name("NAME");

  auto* source = command->add_option_group("source", "one of these");
  auto* mesh =
      source->add_option("--mesh", arguments->mesh, "a .ply, .obj, .stl or .dae, seen from around")
          ->check(notEmpty)
          ->type_name("FILE");
  source
      ->add_option("--cloud", arguments->clouds,
                   "clouds of the object alone; several need the camera's poses as VIEWPOINT")
      ->check(notEmpty)
      ->type_name("FILE.pcd");
  source->add_option("--views", arguments->views, "a folder of such clouds, as `objects --export`")
      ->check(notEmpty)
      ->type_name("DIR");
  auto* scene = source
                    ->add_option("--scene", arguments->scenes,
                                 "the object alone on a table: a .pcd, a .bag (its first cloud) or "
                                 "a folder with depth.png")
                    ->check(notEmpty)
                    ->type_name("SCENE");
  source->require_option(1);

  command->add_option("--unit", arguments->unit, "of the mesh: m or mm (default: m)")
      ->check(CLI::IsMember({"m", "mm"}))
      ->needs(mesh);
  command
      ->add_option("--distances", arguments->mesh_views.distances,
                   "of the camera from the mesh [m]: 80 views for each (default: 0.7)")
      ->needs(mesh)
      ->type_name("METRES");
  command
      ->add_flag("--noise", arguments->mesh_views.noise,
                 "see the mesh with the noise, steps and gaps of a Kinect")
      ->needs(mesh);
  command
      ->add_option("--symmetry", arguments->symmetry,
                   "none, axis x|y|z (round), half x|y|z (a half turn) or box, about the middle "
                   "(default: found in the shape)")
      ->expected(1, 2)
      ->type_name("WORDS");
  command->add_option("--topic", arguments->topic, "of a bag (default: its only one with clouds)")
      ->needs(scene);
  command
      ->add_option("--config", arguments->config,
                   "yaml file with a section per stage (default: built-in values)")
      ->needs(scene)
      ->type_name("YAML");
  command->add_option("--up", arguments->up, "direction against gravity in the cloud's frame")
      ->needs(scene)
      ->type_size(3)
      ->expected(1)
      ->type_name("X Y Z");
  command->footer(
      "Poses found later map the frame of the mesh, of the clouds or of the scene's cloud.\n"
      "An object of the same name is replaced, at the very end and in one step.\n"
      "Exit code: 0 done, 2 bad usage or unreadable input.\n"
      "Example: tabletop train --database objects.db --name can --mesh can.ply");
  command->callback([arguments] { train(*arguments); });
}

}  // namespace tabletop_perception::tools
