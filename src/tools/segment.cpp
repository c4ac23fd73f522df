#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "result_json.h"
#include "result_text.h"
#include "scene_arguments.h"
#include "scene_source.h"
#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/pcd.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;

namespace {

struct SegmentArguments : SceneArguments {
  std::string output;  ///< a .pcd, or a folder of NAME.pcd; empty: nothing is written
};

/// A label for each of the scene's points where the voxel grid gave the segmentation others: that
/// of the nearest of these, which is at most a cube's diagonal away if a point went into it.
std::vector<std::uint32_t> spreadLabels(const Segmentation& segmentation, const Cloud& cloud,
                                        double leaf_size) {
  const auto kept = validIndices(segmentation.filtered);
  const KdTree tree(pointsAt(segmentation.filtered, kept));
  const auto filtered_labels = segmentation.labels();
  const double reach = std::sqrt(3.0) * leaf_size;

  std::vector<std::uint32_t> labels(cloud.size(), 0);
  for (const int i : validIndices(cloud)) {
    const auto nearest = tree.nearest(cloud.point(i));
    if (nearest.index >= 0 && nearest.squared_distance <= reach * reach)
      labels[i] = filtered_labels[kept[nearest.index]];
  }
  return labels;
}

/// The scene's own points, in its own frame, with the labels of the segmentation.
PcdContents labelledScene(const Scene& scene, const Segmentation& segmentation, double leaf_size) {
  PcdContents contents;
  contents.labels =
      leaf_size > 0 ? spreadLabels(segmentation, scene.cloud, leaf_size) : segmentation.labels();
  contents.cloud = scene.cloud;
  contents.T_data_sensor.translation() = scene.sensor;
  if (!scene.sensor.isZero()) {
    const Eigen::Vector3f sensor = scene.sensor.cast<float>();
    for (const int i : validIndices(scene.cloud))
      contents.cloud.setPoint(i, scene.cloud.point(i) + sensor);
  }
  return contents;
}

/// Says which file a scene's labels go to.
class LabelFiles {
 public:
  explicit LabelFiles(const fs::path& output) : single_(output) {
    if (output.extension() != ".pcd") folder_.emplace(output);
  }

  fs::path fileFor(const std::string& scene_name) {
    if (folder_) return folder_->fileFor(scene_name, ".pcd");
    if (used_)
      throw std::invalid_argument("--output " + single_.string() +
                                  " holds one scene, give a folder for several");
    used_ = true;
    return single_;
  }

 private:
  fs::path single_;
  std::optional<OutputFolder> folder_;
  bool used_ = false;
};

void segment(const SegmentArguments& arguments) {
  const auto options = pipelineOptions(arguments);
  const auto stated_up = statedUp(arguments);
  std::optional<LabelFiles> files;
  if (!arguments.output.empty()) files.emplace(arguments.output);

  bool any_object = false;
  visitScenes(arguments.scenes, arguments.topic, [&](const Scene& scene) {
    const auto up = stated_up ? stated_up : scene.up;
    const auto segmentation = segmentScene(scene.cloud, up, options);
    if (files)
      writePcd(files->fileFor(scene.name),
               labelledScene(scene, segmentation, options.filter.leaf_size));
    if (arguments.json)
      std::fputs(jsonLine(segmentationJson(scene, segmentation)).c_str(), stdout);
    else
      printSegmentation(scene, segmentation, up);
    std::fflush(stdout);
    any_object = any_object || !segmentation.clusters.empty();
  });
  if (!any_object) throw CommandFailed{1};
}

}  // namespace

void addSegment(CLI::App& app) {
  auto* command = app.add_subcommand("segment", "find the table and the things that stand on it");
  const auto arguments = std::make_shared<SegmentArguments>();
  addSceneArguments(*command, *arguments);
  command
      ->add_option("--output", arguments->output,
                   "write labels: a .pcd for one scene, else a folder of NAME.pcd")
      ->type_name("OUT");
  command->footer(
      "Labels: 0 nothing or invalid, 1 table, 2 and up one object each. Metres throughout.\n"
      "Exit code: 0 done, 1 no scene had an object, 2 bad usage or unreadable input.\n"
      "Example: tabletop segment scene.pcd --up 0 -1 0 --output labels.pcd");
  command->callback([arguments] { segment(*arguments); });
}

}  // namespace tabletop_perception::tools
