#include "benchmark_stages.h"

#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "benchmark_pick.h"
#include "benchmark_recognition.h"
#include "stock_pcl.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/packed_cloud.h"
#include "tabletop_perception/planes.h"

namespace tabletop_perception::tools {
namespace {

constexpr double SLOW_MS = 300;
constexpr int SLOW_RUNS = 5;

/// Has malloc sort the small pieces that were freed, which it puts off until the next large
/// allocation: neither side pays for what the other left behind.
void tidyHeap() { std::free(std::malloc(1 << 20)); }

Timing timeAlone(int runs, const std::function<void()>& work) {
  work();
  std::vector<double> times;
  while (static_cast<int>(times.size()) < runs) times.push_back(millisecondsOf(work));
  return timingOf(std::move(times));
}

/// The bytes of a message of PCL's as the core reads them.
PackedCloud packedView(const pcl::PCLPointCloud2& message) {
  PackedCloud packed;
  packed.width = message.width;
  packed.height = message.height;
  packed.point_step = message.point_step;
  packed.row_step = message.row_step;
  packed.big_endian = message.is_bigendian != 0;
  for (const auto& field : message.fields)
    packed.fields.push_back({field.name, field.offset, field.datatype, field.count});
  packed.data = message.data.data();
  packed.data_size = message.data.size();
  return packed;
}

/// A figure of /proc/self/status in kB; none where there is no such file.
std::optional<double> statusKilobytes(const std::string& name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind(name + ":", 0) == 0) return std::stod(line.substr(name.size() + 1));
  return std::nullopt;
}

/// By how much the process grows at most while it works, in memory that it really touches
/// [1e6 bytes]. Free memory goes back to the system first, so that none of it is used unseen.
std::optional<double> workingMemory(const std::function<void()>& work) {
  work();  // what is set up once and stays
  malloc_trim(0);
  std::ofstream reset("/proc/self/clear_refs");
  reset << "5" << std::flush;  // the peak starts again from here
  const auto before = statusKilobytes("VmRSS");
  if (!reset || !before) return std::nullopt;
  work();
  return std::max(0.0, *statusKilobytes("VmHWM") - *before) * 1024e-6;
}

/// The stage labels that leave the front end, as the cluster nodelet publishes them.
std::vector<std::uint32_t> frontEnd(const PackedCloud& packed,
                                    const std::optional<Eigen::Vector3d>& up,
                                    const PipelineOptions& options) {
  const Cloud filtered = filterCloud(packed, options.filter);
  const auto tables = findTables(filtered, up, options.table);
  if (!tables) return {};
  const auto clusters =
      extractClusters(filtered, indicesOnTables(filtered, *tables, options.table), options.cluster);
  return labelsOf(filtered.size(), tables->front().inliers, clusters);
}

/// Angle of a normal to a direction, either way round [deg]; none for NaN.
std::optional<double> angleDeg(const Eigen::Vector3d& normal, const Eigen::Vector3d& direction) {
  const double cosine = std::abs(normal.dot(direction));
  if (std::isnan(cosine)) return std::nullopt;
  return std::acos(std::min(1.0, cosine)) * 180 / M_PI;
}

/// `normalAt(i)`: the normal of pixel i, NaN for none.
template <typename NormalAt>
NormalsQuality qualityOf(const Cloud& cloud, const Table& table, NormalAt normalAt) {
  const Indices valid = validIndices(cloud);
  NormalsQuality quality;
  for (const int i : valid) quality.valid_share += !std::isnan(normalAt(i).x());
  quality.valid_share /= std::max<double>(1.0, static_cast<double>(valid.size()));

  std::vector<double> errors;
  for (const int i : table.inliers)
    if (const auto angle = angleDeg(normalAt(i), table.plane.head<3>())) errors.push_back(*angle);
  if (errors.empty()) return quality;
  std::sort(errors.begin(), errors.end());
  quality.median_error_deg = errors[errors.size() / 2];
  quality.p95_error_deg = errors[static_cast<std::size_t>(0.95 * errors.size())];
  return quality;
}

NormalsQuality ourQuality(const Cloud& cloud, const Table& table, const NormalsOptions& options) {
  const Normals normals = computeNormals(cloud, Eigen::Vector3f::Zero(), options);
  return qualityOf(cloud, table, [&](int i) {
    return Eigen::Vector3d(normals.x[i], normals.y[i], normals.z[i]);
  });
}

NormalsQuality stockQuality(const Cloud& cloud, const Table& table, const std::string& method) {
  const auto normals = stock::packagedPcl().normals(stock::pointsOf(cloud), method);
  return qualityOf(cloud, table, [&](int i) {
    return Eigen::Vector3d((*normals)[i].getNormalVector3fMap().cast<double>());
  });
}

/// Appends stages to a scene's timing.
class Stages {
 public:
  Stages(SceneTiming& timing, int runs) : timing_(timing), runs_(runs) {}

  /// `stock`: to be called with a build of PCL.
  template <typename Ours, typename Stock>
  void time(const std::string& name, const std::string& stock_name, Ours ours, Stock stock) {
    std::function<void()> rebuilt;
#ifdef TABLETOP_REBUILT_PCL
    rebuilt = discarding([&] { return stock(stock::rebuiltPcl()); });
#endif
    timing_.stages.push_back(timeInTurn(name, stock_name, runs_, discarding(ours),
                                        discarding([&] { return stock(stock::packagedPcl()); }),
                                        rebuilt));
  }

 private:
  SceneTiming& timing_;
  int runs_;
};

void timeWholeFrame(const Cloud& cloud, const pcl::PCLPointCloud2& message,
                    const stock::Forward& forward, Stages& stages) {
  const auto packed = packedView(message);
  stages.time(
      "crop", "PassThrough",
      [&] { return unpackCloud(packed, stock::MIN_DEPTH, stock::MAX_DEPTH); },
      [&](const stock::Build& pcl) { return pcl.crop(message, forward, true); });
  const stock::Points::ConstPtr points = stock::pointsOf(cloud);
  stages.time(
      "voxel_grid", "VoxelGrid", [&] { return voxelGrid(cloud, stock::LEAF); },
      [&](const stock::Build& pcl) { return pcl.voxelGrid(points); });
  if (!cloud.organized()) return;
  stages.time(
      "normals", "IntegralImageNormalEstimation",
      [&] { return computeNormals(cloud, Eigen::Vector3f::Zero(), NormalsOptions()); },
      [&](const stock::Build& pcl) { return pcl.normals(points, "covariance"); });
}

void compareNormals(const Cloud& cloud, const Table& table, int runs, SceneTiming& timing) {
  const stock::Points::ConstPtr points = stock::pointsOf(cloud);
  for (const std::string method :
       {"window", "average_depth_change", "average_3d_gradient", "covariance"}) {
    NormalsOptions options;
    options.method = method;
    const auto ours =
        discarding([&] { return computeNormals(cloud, Eigen::Vector3f::Zero(), options); });
    NormalsTiming entry;
    entry.method = method;
    entry.our_quality = ourQuality(cloud, table, options);
    if (method == "window") {
      entry.ours = timeAlone(runs, ours);
    } else {
      const auto pair =
          timeInTurn(method, "IntegralImageNormalEstimation", runs, ours,
                     discarding([&] { return stock::packagedPcl().normals(points, method); }));
      entry.ours = pair.ours;
      entry.pcl = pair.pcl;
      entry.pcl_quality = stockQuality(cloud, table, method);
    }
    timing.normals_methods.push_back(std::move(entry));
  }
}

/// `standing`: the points of `filtered` that are to be clustered.
void timeClusters(const Cloud& filtered, const Indices& standing, const ClusterOptions& options,
                  Stages& stages) {
  const stock::Points::ConstPtr voxels =
      stock::packagedPcl().voxelGrid(stock::pointsOf(keepPoints(filtered, standing)));
  const auto ours = [&] { return extractClusters(filtered, standing, options); };
  stages.time("clusters", "EuclideanClusterExtraction", ours,
              [&](const stock::Build& pcl) { return pcl.euclideanClusters(voxels); });
  if (!filtered.organized()) return;
  const stock::Points::ConstPtr points = stock::pointsOf(filtered);
  const stock::Labels::Ptr labels(new stock::Labels(filtered.width, filtered.height));
  for (const int i : standing) (*labels)[i].label = 1;
  stages.time("clusters_organized", "OrganizedConnectedComponentSegmentation", ours,
              [&](const stock::Build& pcl) { return pcl.organizedClusters(points, labels); });
}

}  // namespace

double millisecondsOf(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

Timing timingOf(std::vector<double> times_ms) {
  std::sort(times_ms.begin(), times_ms.end());
  const std::size_t n = times_ms.size();
  return {times_ms.front(), (times_ms[(n - 1) / 2] + times_ms[n / 2]) / 2, static_cast<int>(n)};
}

StageTiming timeInTurn(const std::string& name, const std::string& stock_name, int runs,
                       const std::function<void()>& ours, const std::function<void()>& stock,
                       const std::function<void()>& rebuilt) {
  ours();  // nobody pays for cold caches
  if (rebuilt) rebuilt();
  const bool slow = millisecondsOf(stock) > SLOW_MS;
  const int stock_runs = slow ? std::min(runs, SLOW_RUNS) : runs;
  std::vector<double> our_times, stock_times, rebuilt_times;
  for (int run = 0; run < runs; ++run) {
    tidyHeap();
    our_times.push_back(millisecondsOf(ours));
    if (run >= stock_runs) continue;
    tidyHeap();
    stock_times.push_back(millisecondsOf(stock));
    if (!rebuilt) continue;
    tidyHeap();
    rebuilt_times.push_back(millisecondsOf(rebuilt));
  }
  StageTiming timing{name, stock_name, timingOf(std::move(our_times)),
                     timingOf(std::move(stock_times)), std::nullopt};
  if (rebuilt) timing.rebuilt = timingOf(std::move(rebuilt_times));
  return timing;
}

SceneTiming benchmarkScene(const Scene& scene, const std::optional<Eigen::Vector3d>& up,
                           const PipelineOptions& options, const ModelIndex* models, int runs) {
  cv::setNumThreads(1);
  stock::silence();
  SceneTiming timing;
  timing.scene = scene.name;
  Stages stages(timing, runs);
  const auto message = stock::packedMessage(scene.cloud);
  const auto forward = stock::forwardOf(scene.cloud);
  timeWholeFrame(scene.cloud, message, forward, stages);

  const Cloud filtered = filterCloud(scene.cloud, options.filter);
  const auto& pcl = stock::packagedPcl();
  const stock::Points::ConstPtr voxels = pcl.voxelGrid(pcl.crop(message, forward, false));
  if (!voxels->empty())
    stages.time(
        "plane", "SACSegmentation",
        [&] { return findLargestPlane(filtered, stock::PLANE_DISTANCE, std::nullopt, 1); },
        [&](const stock::Build& pcl) { return pcl.planeInliers(voxels); });
  const auto table = findTable(filtered, up, options.table);
  timing.reason = table.reason;
  if (table) {
    timing.table =
        timeAlone(runs, discarding([&] { return findTable(filtered, up, options.table); }));
    const Indices standing = indicesOnTables(filtered, {*table}, options.table);
    timeClusters(filtered, standing, options.cluster, stages);
    const auto packed = packedView(message);
    stages.time(
        "front_end", "PassThrough to clusters", [&] { return frontEnd(packed, up, options); },
        [&](const stock::Build& pcl) { return pcl.frontEnd(message, forward); });
    const auto clusters = extractClusters(filtered, standing, options.cluster);
    timing.split = timeAlone(
        runs, discarding([&] { return splitClusters(filtered, clusters, options.split); }));
    if (scene.cloud.organized()) {
      timing.our_normals = ourQuality(scene.cloud, *table, NormalsOptions());
      timing.pcl_normals = stockQuality(scene.cloud, *table, "covariance");
      compareNormals(scene.cloud, *table, runs, timing);
    }
  }
  const auto segmentation = segmentScene(scene.cloud, up, options);
  for (auto& stage : benchmarkPick(scene.cloud, segmentation, up, options, runs))
    timing.stages.push_back(std::move(stage));
  if (models) {
    for (auto& stage : benchmarkRecognition(segmentation, *models, runs))
      timing.stages.push_back(std::move(stage));
    timing.recognition = timeAlone(
        runs, discarding([&] { return recognizeScene(scene.cloud, up, *models, options); }));
  }

  const auto peak = statusKilobytes("VmHWM");  // before it starts again
  timing.process_peak_mb = peak.value_or(0) * 1024e-6;
  timing.frame_mb = workingMemory([&] {
    const auto packed = packedView(message);
    segmentScene(unpackCloud(packed), up, options).labels();
  });
  return timing;
}

}  // namespace tabletop_perception::tools
