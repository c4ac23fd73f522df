#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <stdexcept>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "commands.h"
#include "progress.h"
#include "scene_arguments.h"
#include "tabletop_perception/model.h"
#include "tabletop_perception/simulate.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr double DEPTH_UNIT = 1e-4;  // of the depth images [m]

struct SimulateArguments {
  std::string models;               ///< folder of OBJECT/mesh.ply
  std::vector<std::string> meshes;  ///< NAME=FILE
  std::size_t scenes = 0;
  int frames = 0;      ///< of each scene; 0: a picture alone
  bool still = false;  ///< nothing happens from frame to frame
  SimulationOptions options;
  std::uint64_t seed = 0;
  std::string output;
};

/// OBJECT/mesh.ply in a folder, by name.
std::map<std::string, fs::path> meshesIn(const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw std::invalid_argument("--models must be a folder, got '" + folder.string() + "'");
  std::map<std::string, fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (fs::exists(entry.path() / "mesh.ply"))
      files[entry.path().filename()] = entry.path() / "mesh.ply";
  if (files.empty())
    throw std::invalid_argument("--models: no OBJECT/mesh.ply in " + folder.string());
  return files;
}

/// NAME=FILE, each name once.
std::map<std::string, fs::path> meshesNamed(const std::vector<std::string>& words) {
  std::map<std::string, fs::path> files;
  for (const auto& word : words) {
    const auto split = word.find('=');
    if (split == word.npos)
      throw std::invalid_argument("--mesh must be NAME=FILE, got '" + word + "'");
    if (!files.emplace(word.substr(0, split), word.substr(split + 1)).second)
      throw std::invalid_argument("--mesh: '" + word.substr(0, split) + "' is there twice");
  }
  return files;
}

TableObjects readObjects(const SimulateArguments& arguments) {
  const auto files =
      arguments.models.empty() ? meshesNamed(arguments.meshes) : meshesIn(arguments.models);
  TableObjects objects;
  for (const auto& [name, file] : files) {
    checkObjectName(name);
    const Mesh mesh = readMesh(file, 1);
    try {
      objects.push_back(std::make_unique<TableObject>(name, mesh));
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(file.string() + ": " + error.what());
    }
  }
  return objects;
}

void writeImage(const fs::path& file, const cv::Mat& image) {
  bool written = false;
  try {
    written = cv::imwrite(file.string(), image);
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written) throw std::runtime_error(file.string() + ": cannot be written");
}

cv::Mat depthImage(const Cloud& cloud) {
  cv::Mat image(cloud.height, cloud.width, CV_16UC1, cv::Scalar(0));
  for (const int i : validIndices(cloud))
    image.at<std::uint16_t>(i / cloud.width, i % cloud.width) =
        static_cast<std::uint16_t>(std::lround(cloud.z[i] / DEPTH_UNIT));
  return image;
}

cv::Mat colorImage(const Cloud& cloud) {
  cv::Mat image(cloud.height, cloud.width, CV_8UC3);
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
    const auto rgb = cloud.rgb[i];
    image.at<cv::Vec3b>(i / cloud.width, i % cloud.width) = cv::Vec3b(rgb, rgb >> 8, rgb >> 16);
  }
  return image;
}

/// Labels are few: a byte each.
cv::Mat labelImage(const SimulatedScene& scene) {
  cv::Mat image(scene.cloud.height, scene.cloud.width, CV_8UC1);
  std::copy(scene.labels.begin(), scene.labels.end(), image.begin<std::uint8_t>());
  return image;
}

ordered_json poseRows(const Eigen::Isometry3d& pose) {
  auto rows = ordered_json::array();
  for (int r = 0; r < 3; ++r) rows.push_back({pose(r, 0), pose(r, 1), pose(r, 2), pose(r, 3)});
  return rows;
}

ordered_json truthJson(const SimulatedScene& scene, const SimulateArguments& arguments) {
  const auto& camera = arguments.options.projection;
  ordered_json json = {
      {"dataset", "simulated"},
      {"seed", arguments.seed},
      {"camera",
       {{"width", camera.width},
        {"height", camera.height},
        {"fx", camera.fx},
        {"fy", camera.fy},
        {"cx", camera.cx},
        {"cy", camera.cy}}},
      {"depth_unit_m", DEPTH_UNIT},
      {"depth_invalid", 0},
      {"camera_frame", "optical: x right, y down, z forward, metres"},
      {"up", {scene.up.x(), scene.up.y(), scene.up.z()}},
      {"table",
       {{"plane", {scene.plane[0], scene.plane[1], scene.plane[2], scene.plane[3]}},
        {"label_value", SimulatedScene::TABLE}}},
      {"objects", ordered_json::array()}};
  for (const auto& object : scene.objects)
    json["objects"].push_back({{"name", object.name},
                               {"label_value", object.label},
                               {"visible_pixels", object.visible_pixels},
                               {"visible_share", object.visible},
                               {"moving", object.moving},
                               {"model_to_camera_3x4", poseRows(object.T_camera_object)}});
  return json;
}

void writeScene(const fs::path& folder, const SimulatedScene& scene,
                const SimulateArguments& arguments) {
  std::error_code error;
  fs::create_directories(folder, error);
  writeImage(folder / "depth.png", depthImage(scene.cloud));
  writeImage(folder / "color.png", colorImage(scene.cloud));
  writeImage(folder / "label.png", labelImage(scene));
  std::ofstream stream(folder / "gt.json");
  stream << truthJson(scene, arguments).dump(1) << '\n' << std::flush;
  if (!stream) throw std::runtime_error((folder / "gt.json").string() + ": cannot be written");
}

std::string numbered(std::size_t i) {
  char name[32];
  std::snprintf(name, sizeof name, "%06zu", i);
  return name;
}

void simulate(const SimulateArguments& arguments) {
  const auto objects = readObjects(arguments);
  OutputFolder folder(arguments.output);
  ProgressBar progress("simulating");
  for (std::size_t i = 0; i < arguments.scenes; ++i) {
    Random random(arguments.seed, i);
    const auto write = [&](const std::string& name, const SimulatedScene& scene, double share) {
      writeScene(folder.fileFor(name, ""), scene, arguments);
      progress.show((static_cast<double>(i) + share) / static_cast<double>(arguments.scenes));
    };
    if (arguments.frames == 0) {
      write(numbered(i), simulateScene(objects, arguments.options, random), 1);
      continue;
    }
    const auto visit = [&](int frame, const SimulatedScene& scene) {
      write(numbered(i) + "_" + numbered(frame), scene, (frame + 1.0) / arguments.frames);
    };
    if (arguments.still)
      simulateStill(objects, arguments.options, arguments.frames, random, visit);
    else
      simulateSequence(objects, arguments.options, arguments.frames, random, visit);
  }
}

}  // namespace

void addSimulate(CLI::App& app) {
  constexpr std::size_t MAX_OBJECTS = 200;  // labels are bytes
  auto* command = app.add_subcommand("simulate", "scenes on a table with known poses, from meshes");
  const auto arguments = std::make_shared<SimulateArguments>();
  auto& options = arguments->options;
  auto* source = command->add_option_group("objects");
  source->add_option("--models", arguments->models, "folder of OBJECT/mesh.ply [m]")
      ->type_name("DIR");
  source->add_option("--mesh", arguments->meshes, "mesh files [m] and the names of their objects")
      ->type_name("NAME=FILE");
  source->require_option(1);
  command->add_option("--scenes", arguments->scenes, "number of scenes")
      ->required()
      ->check(CLI::Range(std::size_t{1}, std::size_t{1000000}));
  command->add_option("--objects", options.objects, "objects in each scene")
      ->required()
      ->check(CLI::Range(std::size_t{1}, MAX_OBJECTS));
  command
      ->add_option("--gap", options.gap,
                   "distance of each object to the nearest one before it [m]; 0: they touch")
      ->required()
      ->check(CLI::Range(0.0, 1.0));
  command
      ->add_option_function<double>(
          "--distance",
          [&options](double distance) { options.min_distance = options.max_distance = distance; },
          "of the camera from the table's middle [m] (default: 0.6 to 1.2, at random)")
      ->check(CLI::Range(0.3, 5.0))
      ->type_name("M");
  command->add_option("--seed", arguments->seed, "the same seed gives the same files")->required();
  command->add_option("--output", arguments->output, "folder for the scenes, NNNNNN each")
      ->type_name("DIR")
      ->required();
  auto* sequence =
      command
          ->add_option("--sequence", arguments->frames,
                       "frames of each scene, in which things are put down, moved, hidden by a "
                       "forearm and taken away")
          ->check(CLI::Range(1, 1000000))
          ->type_name("FRAMES");
  command
      ->add_flag("--still", arguments->still,
                 "nothing happens in these frames, only the sensor's noise is new")
      ->needs(sequence);
  command->footer(
      "Each scene is a folder with depth.png, color.png, label.png and gt.json, as recognize and\n"
      "evaluate --poses read it. Labels are 0 nothing or floor, 1 table, 2 and up the objects.\n"
      "Scene i does not depend on --scenes. Frames are SCENE_FRAME.\n"
      "Exit code: 0 done, 2 bad usage, unreadable input or too many objects for the table.\n"
      "Example: tabletop simulate --models models --scenes 20 --objects 5 --gap 0.02 --seed 1 "
      "--output truth");
  command->callback([arguments] { simulate(*arguments); });
}

}  // namespace tabletop_perception::tools
