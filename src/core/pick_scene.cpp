#include "tabletop_perception/pick_scene.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "stop_watch.h"

namespace tabletop_perception {
namespace {

constexpr int TABLE_COLUMNS = 106;  // of the image in which tables are looked for: the grid of
                                    // their normals needs no more
constexpr int PICK_COLUMNS = 320;  // of the image that a thing is found in, the window a part of it

constexpr std::uint32_t FIRST_LABEL = 2;  // of clusters: that of the thing

/// Between the pixels of which an image of so many columns, or some more, is made.
int stepOf(const Cloud& cloud, int columns) {
  return cloud.organized() ? std::max(1, cloud.width / columns) : 1;
}

/// A count of points for every step-th pixel and row.
int decimated(int points, int step) { return std::max(1, points / (step * step)); }

TableOptions decimated(TableOptions options, int step) {
  options.min_points = std::max(10, decimated(options.min_points, step));
  options.min_carried = decimated(options.min_carried, step);
  return options;
}

PipelineOptions decimated(PipelineOptions options, int step) {
  options.table = decimated(options.table, step);
  for (int* points :
       {&options.cluster.min_points, &options.cluster.max_points, &options.split.min_patch_points,
        &options.split.min_points, &options.color.min_points})
    *points = decimated(*points, step);
  return options;
}

Indices withinReach(const Cloud& cloud, const Indices& indices, const Eigen::Vector3f& point,
                    double reach) {
  const auto squared_reach = static_cast<float>(reach * reach);
  Indices near;
  std::copy_if(indices.begin(), indices.end(), std::back_inserter(near),
               [&](int i) { return (cloud.point(i) - point).squaredNorm() <= squared_reach; });
  return near;
}

/// Groups of a window's points: of the cluster at the point the parts, the one there first, and all
/// other clusters.
struct ClustersAt {
  std::vector<Indices> parts, others;
};

/// What `watch` measures begins with the points on the tables.
Found<ClustersAt> clustersAt(const Cloud& cloud, const Eigen::Vector3f& point,
                             const std::vector<Table>& tables, const PipelineOptions& options,
                             StopWatch& watch) {
  const Indices standing =
      withinReach(cloud, indicesOnTables(cloud, tables, options.table), point, options.pick.reach);
  watch.lap("box");
  auto clusters = extractClusters(cloud, standing, options.cluster);
  const auto whole = clusterAt(cloud, clusters, point, tables, options.table, options.pick);
  watch.lap("cluster");
  if (!whole) return Found<ClustersAt>::none(whole.reason);
  const Indices cluster = std::move(clusters[*whole]);
  clusters.erase(clusters.begin() + *whole);
  auto parts = splitClusters(cloud, {cluster}, options.split);
  watch.lap("split");
  parts = colorCorrected(cloud, parts, options.color);
  const auto thing = clusterAt(cloud, parts, point, tables, options.table, options.pick);
  watch.lap("color");
  if (!thing && whole.reason.empty()) return Found<ClustersAt>::none(thing.reason);
  if (thing)
    std::rotate(parts.begin(), parts.begin() + *thing, parts.begin() + *thing + 1);
  else  // all around the point, but in parts
    parts = {cluster};
  return ClustersAt{std::move(parts), std::move(clusters)};
}

/// Of a window's points those that every step-th pixel of the whole cloud shows, none put in its
/// place: of a thing all faces to their share.
Indices evenlySpaced(const Cloud& whole, const CloudWindow& window, const Indices& points) {
  if (window.step == 1 || !window.cloud.organized()) return points;
  Indices even;
  std::copy_if(points.begin(), points.end(), std::back_inserter(even),
               [&](int i) { return whole.point(window.sourceOf(i)) == window.cloud.point(i); });
  return even;
}

/// `whole`: the cloud of the window.
Found<Pick> pickInWindow(Pick pick, const Cloud& whole, const std::vector<Table>& tables,
                         const PipelineOptions& whole_options) {
  StopWatch watch(pick.times_ms);
  const PipelineOptions options = decimated(whole_options, pick.window.step);
  const Cloud& cloud = pick.window.cloud;
  auto clusters = clustersAt(cloud, pick.point, tables, options, watch);
  if (!clusters) return Found<Pick>::none(clusters.reason);
  pick.clusters = std::move(clusters.value->parts);
  pick.others = std::move(clusters.value->others);

  const auto points = pointsAt(cloud, pick.thing());
  pick.table = tables[tableUnder(tables, centroidOf(points))];
  pick.table.inliers.clear();
  const auto surface =
      graspSurface(cloud, evenlySpaced(whole, pick.window, pick.thing()), pick.table, options.pick);
  if (!surface) return Found<Pick>::none(surface.reason);
  pick.surface = *surface;
  pick.box = boxAround(points, pick.table.plane.head<3>());
  pick.pregrasp = pregraspAbove(pick.box, pick.table, options.grasp);
  watch.lap("frame");
  return pick;
}

/// Of the four pixels of a coarser window around a pixel the one nearest in space, -1 for one that
/// lies across a step in depth from all of them.
int nearestCell(const Cloud& cloud, int i, const CloudWindow& window) {
  const Cloud& coarse = window.cloud;
  const Eigen::Vector3f p = cloud.point(i);
  const int column = i % cloud.width / window.step, row = i / cloud.width / window.step;
  constexpr float SAME_SURFACE = 0.02f * 0.02f;  // of the range, squared
  int nearest = -1;
  float least = SAME_SURFACE * p.squaredNorm();
  for (int v = row; v <= std::min(row + 1, coarse.height - 1); ++v)
    for (int u = column; u <= std::min(column + 1, coarse.width - 1); ++u) {
      const int cell = v * coarse.width + u;
      const float squared = (coarse.point(cell) - p).squaredNorm();  // NaN is never nearer
      if (!(squared < least)) continue;
      nearest = cell;
      least = squared;
    }
  return nearest;
}

/// Why nothing can be picked at a point, whatever the scene; empty if it can.
std::string pointRefusal(const Eigen::Vector3f& point) {
  return point.allFinite() ? "" : "the point is not finite";
}

}  // namespace

Indices pickedPoints(const Pick& pick) {
  Indices points;
  if (!pick.window.cloud.organized() && pick.window.source.empty()) return points;
  for (const int i : pick.thing()) points.push_back(pick.window.sourceOf(i));
  return points;
}

Found<Pick> pickThing(const Cloud& cloud, const Eigen::Vector3f& point,
                      const std::vector<Table>& tables, const PipelineOptions& options) {
  checkOptions("pick", options.pick);
  const std::string refusal = pointRefusal(point);
  if (!refusal.empty()) return Found<Pick>::none(refusal);
  if (tables.empty()) return Found<Pick>::none("no table");
  Pick pick;
  StopWatch watch(pick.times_ms);
  pick.point = point;
  pick.window = windowAround(cloud, point, options.pick.reach, stepOf(cloud, PICK_COLUMNS));
  watch.lap("window");
  return pickInWindow(std::move(pick), cloud, tables, options);
}

Found<Pick> pickInScene(const Cloud& cloud, const Eigen::Vector3f& point,
                        const std::optional<Eigen::Vector3d>& up, const PipelineOptions& options) {
  checkOptions("pick", options.pick);
  const std::string refusal = pointRefusal(point);
  if (!refusal.empty()) return Found<Pick>::none(refusal);
  Pick pick;
  pick.point = point;
  StopWatch watch(pick.times_ms);
  const int step = stepOf(cloud, TABLE_COLUMNS);
  const Cloud coarse = filterCloud(step > 1 ? decimated(cloud, step) : cloud, options.filter);
  watch.lap("decimate");
  const auto tables = findTables(coarse, up, decimated(options.table, step));
  watch.lap("table");
  if (!tables) return Found<Pick>::none("no table: " + tables.reason);

  pick.window = windowAround(cloud, point, options.pick.reach, stepOf(cloud, PICK_COLUMNS));
  pick.window.cloud = filterCloud(std::move(pick.window.cloud), options.filter);
  if (options.filter.leaf_size > 0) pick.window.source.clear();
  watch.lap("window");
  return pickInWindow(std::move(pick), cloud, *tables, options);
}

Pick atFullResolution(const Cloud& cloud, Pick pick) {
  if (pick.window.step == 1 || !pick.window.cloud.organized()) return pick;
  StopWatch watch(pick.times_ms);
  CloudWindow full = withEveryPixel(cloud, pick.window);
  std::vector<Indices> all = std::move(pick.clusters);
  const auto parts = static_cast<std::ptrdiff_t>(all.size());
  all.insert(all.end(), pick.others.begin(), pick.others.end());
  const auto labels = labelsOf(pick.window.cloud.size(), {}, all);
  for (auto& cluster : all) cluster.clear();
  for (int i = 0; i < static_cast<int>(full.cloud.size()); ++i) {
    if (!full.cloud.valid(i)) continue;
    const int cell = nearestCell(full.cloud, i, pick.window);
    const std::uint32_t label = cell < 0 ? 0 : labels[cell];
    if (label >= FIRST_LABEL) all[label - FIRST_LABEL].push_back(i);
  }
  pick.clusters.assign(all.begin(), all.begin() + parts);
  pick.others.assign(all.begin() + parts, all.end());
  pick.window = std::move(full);
  watch.lap("pixels");
  return pick;
}

void completePick(Pick& pick, const ObjectModel& model, const Eigen::Isometry3d& T_camera_object,
                  const GraspOptions& options) {
  pick.box =
      boxAround(transformed(model.surface, T_camera_object).points, pick.table.plane.head<3>());
  pick.pregrasp = pregraspAbove(pick.box, pick.table, options);
}

std::vector<PlacedGrasp> graspsOf(const SceneObject& object, const std::vector<Table>& tables,
                                  const ModelIndex& index, const GraspOptions& options) {
  const int model = index.find(object.name);
  if (model < 0 || tables.empty()) return {};
  const Eigen::Vector3f middle = object.box.T_camera_box.translation().cast<float>();
  return placedGrasps(index.models()[model].grasps, object.T_camera_object,
                      tables[tableUnder(tables, middle)], options);
}

}  // namespace tabletop_perception
