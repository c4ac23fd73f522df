#include "benchmark_pick.h"

#include <algorithm>
#include <map>
#include <string>

#include "stock_pick.h"
#include "tabletop_perception/pick_scene.h"

namespace tabletop_perception::tools {
namespace {

/// A step of a pick: what it is called, PCL's classes for it, and the stages of ours that do it.
struct Step {
  std::string name, stock;
  std::vector<std::string> stages;
};

const std::vector<Step>& steps() {
  static const std::vector<Step> all = {
      {"pick_decimate", "copyPointCloud of every second pixel", {"decimate"}},
      {"pick_window", "PassThrough", {"window"}},
      {"pick_plane", "SACSegmentation, ExtractIndices", {"table"}},
      {"pick_box", "CropBox, VoxelGrid", {"box"}},
      {"pick_cluster", "EuclideanClusterExtraction", {"cluster", "split", "color"}},
      {"pick_frame", "SACSegmentation, PCA", {"frame"}},
      {"pick", "all of it", {"total"}}};
  return all;
}

using Times = std::map<std::string, std::vector<double>>;  // of the runs of each step [ms]

void addOurs(const Pick& pick, Times& times) {
  for (const auto& step : steps()) {
    double sum = 0;
    for (const auto& stage : step.stages)
      if (const auto ms = pick.times_ms.find(stage); ms != pick.times_ms.end()) sum += ms->second;
    times[step.name].push_back(sum);
  }
}

void addStock(const stock::Points::ConstPtr& points, const Eigen::Vector3f& point,
              const stock::Forward& forward, double reach, Times& times) {
  stock::Points::Ptr cloud;
  double total = 0;
  const auto time = [&](const std::string& name, const auto& work) {
    const double ms = millisecondsOf(work);
    times[name].push_back(ms);
    total += ms;
  };
  time("pick_decimate", [&] { cloud = stock::decimated(points); });
  time("pick_window", [&] { cloud = stock::depthWindow(cloud, point, forward, reach); });
  time("pick_plane", [&] { cloud = stock::besideLargestPlane(cloud); });
  time("pick_box", [&] { cloud = stock::boxAndVoxels(cloud, point, reach); });
  time("pick_cluster", [&] { cloud = stock::clusterAt(cloud, point); });
  time("pick_frame", discarding([&] { return stock::frameOf(cloud); }));
  times["pick"].push_back(total);
}

}  // namespace

std::vector<StageTiming> benchmarkPick(const Cloud& cloud, const Segmentation& segmentation,
                                       const std::optional<Eigen::Vector3d>& up,
                                       const PipelineOptions& options, int runs) {
  const auto largest =
      std::max_element(segmentation.clusters.begin(), segmentation.clusters.end(),
                       [](const Indices& a, const Indices& b) { return a.size() < b.size(); });
  if (!cloud.organized() || largest == segmentation.clusters.end()) return {};
  const Eigen::Vector3f point = segmentation.filtered.point((*largest)[largest->size() / 2]);
  if (!pickInScene(cloud, point, up, options)) return {};

  const stock::Points::ConstPtr points = stock::pointsOf(cloud);
  const auto forward = stock::forwardOf(cloud);
  Times ours, theirs;
  for (int run = 0; run < runs; ++run) {
    addOurs(*pickInScene(cloud, point, up, options), ours);
    addStock(points, point, forward, options.pick.reach, theirs);
  }
  std::vector<StageTiming> stages;
  for (const auto& step : steps())
    stages.push_back({step.name, step.stock, timingOf(ours[step.name]), timingOf(theirs[step.name]),
                      std::nullopt});
  return stages;
}

}  // namespace tabletop_perception::tools
