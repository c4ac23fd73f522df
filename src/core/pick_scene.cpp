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

constexpr int FINER_CUTS = 2;             // of what resembles nothing, each at half the angle
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

/// The cluster at the point and what hangs together with it, it first; what `watch` measures begins
/// with the points on the tables.
Found<std::vector<Indices>> clustersAt(const Cloud& cloud, const Eigen::Vector3f& point,
                                       const std::vector<Table>& tables,
                                       const PipelineOptions& options, StopWatch& watch) {
  using FoundClusters = Found<std::vector<Indices>>;
  const Indices standing =
      withinReach(cloud, indicesOnTables(cloud, tables, options.table), point, options.pick.reach);
  watch.lap("box");
  const auto clusters = extractClusters(cloud, standing, options.cluster);
  const auto whole = clusterAt(cloud, clusters, point, tables, options.table, options.pick);
  watch.lap("cluster");
  if (!whole) return FoundClusters::none(whole.reason);
  auto parts = splitClusters(cloud, {clusters[*whole]}, options.split);
  watch.lap("split");
  parts = colorCorrected(cloud, parts, options.color);
  const auto thing = clusterAt(cloud, parts, point, tables, options.table, options.pick);
  watch.lap("color");
  if (!thing && whole.reason.empty()) return FoundClusters::none(thing.reason);
  if (!thing) return std::vector<Indices>{clusters[*whole]};  // all around the point, but in parts
  std::rotate(parts.begin(), parts.begin() + *thing, parts.begin() + *thing + 1);
  return parts;
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
  pick.clusters = std::move(*clusters.value);

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

/// Squared distance of a point from a model at its pose; infinite beyond the model's grid [m^2].
float squaredDistance(const ModelIndex& index, const SceneObject& object,
                      const Eigen::Vector3f& point) {
  const int model = index.find(object.name);
  if (model < 0) return std::numeric_limits<float>::infinity();
  const Eigen::Vector3f p = object.T_camera_object.inverse().cast<float>() * point;
  const int nearest = index.grid(model).nearest(p);
  return nearest < 0 ? std::numeric_limits<float>::infinity()
                     : (index.models()[model].surface.points[nearest] - p).squaredNorm();
}

/// The point of what was picked that is nearest to the one that was pointed at, which may lie
/// inside.
Eigen::Vector3f seenPoint(const Pick& pick) {
  const Cloud& scene = pick.window.cloud;
  const auto& thing = pick.thing();
  const auto distance = [&](int i) { return (scene.point(i) - pick.point).squaredNorm(); };
  return scene.point(*std::min_element(thing.begin(), thing.end(),
                                       [&](int a, int b) { return distance(a) < distance(b); }));
}

/// Of the objects in a scene whose first cluster was picked the one at the point.
SceneObject objectAt(const Pick& pick, const std::vector<Indices>& clusters,
                     const ModelIndex& index, const PipelineOptions& options) {
  constexpr float POINTED_AT = 0.015f * 0.015f;  // from what is seen to the model [m^2]
  const Cloud& scene = pick.window.cloud;
  const std::vector<Table> tables = {pick.table};
  const auto proposals = proposeObjects(scene, clusters, tables, index, options.match);
  const auto objects = decideObjects(scene, clusters, proposals, tables, index, options.match,
                                     options.refine, options.verify);
  SceneObject best = unknownObject(scene, clusters.front(), FIRST_LABEL, pick.table);
  best.reason = "part of another object";
  const Eigen::Vector3f seen = seenPoint(pick);
  float least = POINTED_AT;
  for (const auto& object : objects) {
    if (object.name == "unknown") {
      if (best.name == "unknown" && object.labels.front() == FIRST_LABEL) best = object;
      continue;
    }
    const float squared = squaredDistance(index, object, seen);
    if (squared > least) continue;
    best = object;
    least = squared;
  }
  return best;
}

/// What was picked cut at shallower hollows, the part at the point first; nothing where that cuts
/// no better.
std::vector<Indices> cutFiner(const Pick& pick, double concave_angle_deg,
                              const PipelineOptions& options) {
  SplitOptions finer = options.split;
  finer.concave_angle_deg = concave_angle_deg;
  auto parts = splitClusters(pick.window.cloud, {pick.thing()}, finer);
  if (parts.size() < 2) return {};
  const auto at =
      clusterAt(pick.window.cloud, parts, pick.point, {pick.table}, options.table, options.pick);
  if (!at) return {};
  std::rotate(parts.begin(), parts.begin() + *at, parts.begin() + *at + 1);
  return parts;
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
  const auto labels = labelsOf(pick.window.cloud.size(), {}, pick.clusters);
  for (auto& cluster : pick.clusters) cluster.clear();
  for (int i = 0; i < static_cast<int>(full.cloud.size()); ++i) {
    if (!full.cloud.valid(i)) continue;
    const int cell = nearestCell(full.cloud, i, pick.window);
    const std::uint32_t label = cell < 0 ? 0 : labels[cell];
    if (label >= FIRST_LABEL) pick.clusters[label - FIRST_LABEL].push_back(i);
  }
  pick.window = std::move(full);
  watch.lap("pixels");
  return pick;
}

SceneObject recognizePick(const Pick& pick, const ModelIndex& index,
                          const PipelineOptions& options) {
  SceneObject best = objectAt(pick, {pick.thing()}, index, options);
  const auto offer = [&](const std::vector<Indices>& clusters) {
    const SceneObject other = objectAt(pick, clusters, index, options);
    if (other.name != "unknown" && other.score > best.score) best = other;
  };
  if (pick.clusters.size() > 1) offer(pick.clusters);
  double angle_deg = options.split.concave_angle_deg;
  for (int cuts = 0; cuts < FINER_CUTS && best.name == "unknown"; ++cuts) {
    angle_deg /= 2;
    const auto parts = cutFiner(pick, angle_deg, options);
    if (!parts.empty()) offer(parts);
  }
  return best;
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
