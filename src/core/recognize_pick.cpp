#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "cut_by_model.h"
#include "near_model.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/pick_scene.h"
#include "tabletop_perception/propose.h"
#include "tabletop_perception/region_growing.h"

namespace tabletop_perception {
namespace {

constexpr int FINER_CUTS = 2;             // of what resembles nothing, each at half the angle
constexpr double LEAST_ANGLE_DEG = 0.1;   // that a cluster may be cut at
constexpr std::uint32_t FIRST_LABEL = 2;  // of clusters: that of the thing
constexpr float POINTED_AT = 0.015f;      // farthest from what is seen there to the model [m]
constexpr double CUT_DOUBT = 0.8;         // of a cut by a model that may be left, to that of others

/// Squared distance of a point from a known object; infinite far from it [m^2].
float squaredDistanceFrom(const ModelIndex& index, const SceneObject& object,
                          const Eigen::Vector3f& point) {
  const int model = index.find(object.name);
  if (model < 0) return std::numeric_limits<float>::infinity();
  return squaredDistance(index, model, object.T_camera_object.inverse().cast<float>(), point);
}

/// The search for what was picked: looks at it cut in one way and another, and remembers the
/// likeliest answer and what is known around it.
class Search {
 public:
  Search(const Pick& pick, const ModelIndex& index, const PipelineOptions& options)
      : pick_(pick), scene_(pick.window.cloud), index_(index), options_(options) {
    best_ = unknownObject(scene_, pick.thing(), FIRST_LABEL, pick.table);
    best_.reason = "part of another object";
  }

  const SceneObject& best() const { return best_; }
  bool isKnown() const { return best_.name != "unknown"; }

  /// Recognises what some clusters show, if there are any. The first is at the point.
  void look(const std::vector<Indices>& clusters) {
    if (clusters.empty()) return;
    const auto objects = objectsIn(clusters);
    for (const auto& object : objects)
      if (first_look_ && object.name == "unknown" && object.labels.front() == FIRST_LABEL)
        best_ = object;
    first_look_ = false;
    const auto at_point = atPoint(objects, clusters.front());
    for (auto object = objects.begin(); object != objects.end(); ++object)
      if (object->name != "unknown" && object != at_point) around_.push_back(*object);
    if (at_point != objects.end() && (!isKnown() || at_point->score > best_.score))
      best_ = *at_point;
  }

  /// The same of smooth regions of what was picked. A face of an unknown thing is like that of many
  /// a known one: they count only where they show objects of several names.
  void lookAtRegions(const std::vector<Indices>& regions) {
    if (regions.empty()) return;
    const auto objects = objectsIn(regions);
    const auto at_point = atPoint(objects, regions.front());
    if (at_point == objects.end()) return;
    const bool several = std::any_of(objects.begin(), objects.end(), [&](const auto& object) {
      return object.name != "unknown" && object.name != at_point->name;
    });
    if (several) best_ = *at_point;
  }

  /// A cluster cut at hollows of an angle, the part at the point first; nothing where that cuts
  /// nothing.
  std::vector<Indices> cutAt(double concave_angle_deg, const Indices& cluster) const {
    SplitOptions options = options_.split;
    options.concave_angle_deg = std::max(concave_angle_deg, LEAST_ANGLE_DEG);
    auto parts = splitClusters(scene_, {cluster}, options);
    return parts.size() < 2 ? std::vector<Indices>() : partAtPointFirst(std::move(parts));
  }

  /// The smooth regions of a cluster, the one at the point first; nothing where none is there.
  std::vector<Indices> regionsOf(const Indices& cluster) const {
    const Cloud alone = keepPoints(scene_, cluster);
    const Normals normals = computeNormals(alone, Eigen::Vector3f::Zero(), NormalsOptions());
    RegionGrowingOptions growing;
    growing.min_points = options_.split.min_points;
    return partAtPointFirst(growRegions(alone, normals, growing));
  }

  /// What was picked without the points of the objects that are known around it, clustered anew,
  /// the part at the point first; nothing where that leaves none or all of it.
  std::vector<Indices> leftAround() const {
    const auto limit = static_cast<float>(options_.verify.tolerance * options_.verify.tolerance);
    Indices left;
    for (const int i : pick_.thing())
      if (std::none_of(around_.begin(), around_.end(), [&](const SceneObject& object) {
            return squaredDistanceFrom(index_, object, scene_.point(i)) <= limit;
          }))
        left.push_back(i);
    if (left.size() == pick_.thing().size()) return {};
    return partAtPointFirst(extractClusters(scene_, left, options_.cluster));
  }

  /// The same of what models that may stand at the point would explain of all that stands near it.
  /// Each cut is made to fit: it counts only where it shows that model, and more than likely.
  void lookAtCutsByModels() {
    Indices standing;
    for (const auto* clusters : {&pick_.clusters, &pick_.others})
      for (const auto& cluster : *clusters)
        standing.insert(standing.end(), cluster.begin(), cluster.end());
    const std::vector<Table> tables = {pick_.table};
    const Eigen::Vector3f seen = seenPoint(pick_.thing());
    const Observations observations(scene_, tables);
    for (const auto& cut :
         cutsByModels(observations.about(seen), standing, seen, index_, options_.refine)) {
      const auto objects = objectsIn({cut.points});
      const auto at_point = atPoint(objects, cut.points);
      if (at_point == objects.end() || at_point->name != cut.name ||
          1 - at_point->score > CUT_DOUBT * (1 - options_.verify.min_score))
        continue;
      best_ = *at_point;
      return;
    }
  }

 private:
  using Objects = std::vector<SceneObject>;

  Objects objectsIn(const std::vector<Indices>& clusters) const {
    const std::vector<Table> tables = {pick_.table};
    const auto proposals = proposeObjects(scene_, clusters, tables, index_, options_.match);
    return decideObjects(scene_, clusters, proposals, tables, index_, options_.match,
                         options_.refine, options_.verify);
  }

  /// Of some objects the known one at the point, where a cluster is; their end where there is none.
  Objects::const_iterator atPoint(const Objects& objects, const Indices& cluster) const {
    const Eigen::Vector3f seen = seenPoint(cluster);
    auto nearest = objects.end();
    float least = POINTED_AT * POINTED_AT;
    for (auto object = objects.begin(); object != objects.end(); ++object) {
      if (object->name == "unknown") continue;
      const float squared = squaredDistanceFrom(index_, *object, seen);
      if (squared > least) continue;
      nearest = object;
      least = squared;
    }
    return nearest;
  }

  /// The point of a cluster that is nearest to the one that was pointed at, which may lie inside.
  Eigen::Vector3f seenPoint(const Indices& cluster) const {
    const auto distance = [&](int i) { return (scene_.point(i) - pick_.point).squaredNorm(); };
    return scene_.point(*std::min_element(cluster.begin(), cluster.end(),
                                          [&](int a, int b) { return distance(a) < distance(b); }));
  }

  std::vector<Indices> partAtPointFirst(std::vector<Indices> parts) const {
    const auto at =
        clusterAt(scene_, parts, pick_.point, {pick_.table}, options_.table, options_.pick);
    if (!at) return {};
    std::rotate(parts.begin(), parts.begin() + *at, parts.begin() + *at + 1);
    return parts;
  }

  const Pick& pick_;
  const Cloud& scene_;
  const ModelIndex& index_;
  const PipelineOptions& options_;
  bool first_look_ = true;
  SceneObject best_;
  Objects around_;  ///< known, not at the point
};

/// What was picked, what it was cut from and all else near the point, cut where it has hollows.
std::vector<Indices> withOthers(const Pick& pick, const PipelineOptions& options) {
  std::vector<Indices> all = pick.clusters;
  const Cloud& scene = pick.window.cloud;
  const auto others =
      colorCorrected(scene, splitClusters(scene, pick.others, options.split), options.color);
  all.insert(all.end(), others.begin(), others.end());
  return all;
}

}  // namespace

SceneObject recognizePick(const Pick& pick, const ModelIndex& index,
                          const PipelineOptions& options) {
  Search search(pick, index, options);
  search.look({pick.thing()});
  if (pick.clusters.size() > 1) search.look(pick.clusters);
  if (!search.isKnown() && !pick.others.empty()) search.look(withOthers(pick, options));
  const auto cutFiner = [&](const Indices& cluster, double angle_deg) {
    for (int cuts = 0; cuts < FINER_CUTS && !search.isKnown(); ++cuts, angle_deg /= 2)
      search.look(search.cutAt(angle_deg, cluster));
  };
  const double angle_deg = options.split.concave_angle_deg;
  cutFiner(pick.thing(), angle_deg / 2);
  if (search.isKnown()) return search.best();
  auto rest = search.leftAround();
  search.look(rest);
  if (rest.empty())
    rest = {pick.thing()};
  else
    cutFiner(rest.front(), angle_deg);
  if (!search.isKnown()) search.lookAtRegions(search.regionsOf(rest.front()));
  if (!search.isKnown() && options.match.stands) search.lookAtCutsByModels();
  return search.best();
}

}  // namespace tabletop_perception
