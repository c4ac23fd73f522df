#include "tabletop_perception/match.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "tabletop_perception/refine.h"
#include "tabletop_perception/surface_color.h"

namespace tabletop_perception {
namespace {

constexpr int FEW_PROBES = 30;           // points of a cluster that sort out most guesses
constexpr int PROBES = 100;              // and that judge the rest
constexpr int MAX_JUDGED = 300;          // guesses that are held against the picture
constexpr int MAX_ALIGNED = 50;          // guesses that ICP moves
constexpr int MAX_ALIGNED_OF_ONE = 10;   // of them of one model
constexpr double COARSE = 0.02;          // tolerance before ICP [m]
constexpr double FINE = 0.012;           // and after a few steps of it [m]
constexpr double SAME_ANGLE = 0.2;       // candidates nearer than this [rad]
constexpr double SAME_DISTANCE = 0.015;  // and this are one [m]
constexpr double ON_TABLE = 0.015;       // a guess farther than this from the table floats [m]
constexpr double SIZE_SLACK = 0.015;     // of what a side of a model shows [m]
constexpr double MIN_SHOWN = 0.25;       // least extent of a cluster, share of what the side shows
constexpr float SAME_FACING = 0.9f;      // cosine of the normals on one smooth part
constexpr int MIN_PART_POINTS = 40;      // of a smooth part that is looked at for itself
constexpr double LOW_PROMISE = 0.65;     // of a whole cluster: its parts are looked at too

constexpr double HIDDEN_COST = 0.3;  // of a guess that nothing speaks for or against

/// A pose that a cluster may have, before ICP.
struct Guess {
  int model;
  Eigen::Isometry3d T_camera_object;
  double distance;  // of the descriptors; infinite where none was compared
  double promise = 0;
  Agreement agreement = {};
  bool has_color = false;  // the agreement counts the colours, should there be any
};

/// About `count` of the points, evenly taken.
PlanarSurface thinned(const Surface& surface, int count) {
  const std::size_t step = std::max<std::size_t>(1, surface.size() / count);
  Surface few;
  for (std::size_t i = 0; i < surface.size(); i += step) {
    few.points.push_back(surface.points[i]);
    few.normals.push_back(surface.normals[i]);
  }
  return few;
}

bool samePose(const Candidate& a, const Candidate& b) {
  const Eigen::Isometry3d motion = a.T_camera_object.inverse() * b.T_camera_object;
  return a.name == b.name && motion.translation().norm() < SAME_DISTANCE &&
         angleOf(motion.linear()) < SAME_ANGLE;
}

std::string format(const char* text, double value, double limit) {
  char line[160];
  std::snprintf(line, sizeof line, text, value, limit);
  return line;
}

/// Some points of a cluster that a model is to be laid on, and what they tell of its pose.
struct Anchor {
  const Surface& points;
  Eigen::Vector3d centroid;
  Eigen::Vector3d normal;  // of a smooth part; zero for a whole cluster
  double extent;
  double top;  // above the table [m]
};

Anchor anchorOf(const Surface& points, bool smooth, const Table& table) {
  Anchor anchor{points, centroidOf(points.points).cast<double>(), Eigen::Vector3d::Zero(),
                extentOf(points.points), 0};
  if (smooth) {
    for (const auto& normal : points.normals) anchor.normal += normal.cast<double>();
    anchor.normal.normalize();
  }
  for (const auto& p : points.points) anchor.top = std::max(anchor.top, heightAbove(table, p));
  return anchor;
}

/// What of a side of a model an anchor may show: all of it or, of a smooth part, what faces alike.
struct Shown {
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  // in the object's frame [m]
  double extent = 0;                                   // 0: nothing
};

Shown shownOf(const SparseModel& model, const SparseModel::Side& side,
              const Eigen::Vector3f& normal) {
  if (normal.isZero()) return {side.centroid.cast<double>(), side.extent};
  Shown shown;
  Eigen::AlignedBox3f box;
  int count = 0;
  for (const int i : side.visible) {
    if (model.surface.normals[i].dot(normal) < SAME_FACING) continue;
    shown.centroid += model.surface.points[i].cast<double>();
    box.extend(model.surface.points[i]);
    ++count;
  }
  if (count == 0) return shown;
  shown.centroid /= count;
  shown.extent = box.diagonal().norm();
  return shown;
}

/// The poses in which a model stands on the table and shows the camera something like the anchor;
/// those far from the table's height stand on something else.
void addStandingGuesses(const Anchor& anchor, const Table& table, int m, const SparseModel& model,
                        std::vector<Guess>& guesses) {
  const Eigen::Vector3d up = table.plane.head<3>();
  for (const auto& stand : model.stands) {
    for (const double yaw : stand.yaws) {
      const Eigen::Matrix3d R = table.T_camera_table.linear() *
                                Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                                stand.R_table_object;
      const Eigen::Vector3d to_camera = R.transpose() * -anchor.centroid.normalized();
      const auto& side = model.sideTowards(to_camera.cast<float>());
      const Eigen::Vector3d normal = R.transpose() * anchor.normal;
      const Shown shown = shownOf(model, side, normal.cast<float>());
      if (shown.extent <= 0 || anchor.extent > shown.extent + SIZE_SLACK ||
          anchor.extent < MIN_SHOWN * shown.extent)
        continue;
      Guess guess{m, Eigen::Isometry3d(R), std::numeric_limits<double>::infinity()};
      guess.T_camera_object.translation() = anchor.centroid - R * shown.centroid;
      const double lift =
          up.dot(guess.T_camera_object.translation()) + table.plane[3] - stand.origin_height;
      if (std::abs(lift) > ON_TABLE) guesses.push_back(guess);
      if (anchor.top > stand.top_height + ON_TABLE) continue;
      guess.T_camera_object.translation() -= lift * up;
      guesses.push_back(guess);
    }
  }
}

std::vector<Surface> smoothRegionsOf(const Surface& cluster, const DescriptorOptions& options) {
  auto parts = smoothParts(cluster, options);
  parts.pop_back();  // what is not smooth
  const auto small = [](const Surface& part) {
    return static_cast<int>(part.size()) < MIN_PART_POINTS;
  };
  parts.erase(std::remove_if(parts.begin(), parts.end(), small), parts.end());
  return parts;
}

/// The guesses with the highest promise, `limit` of them at most and `of_one` of one model.
std::vector<Guess> best(std::vector<Guess> guesses, int limit, int of_one,
                        const ModelIndex& index) {
  std::stable_sort(guesses.begin(), guesses.end(),
                   [](const Guess& a, const Guess& b) { return a.promise > b.promise; });
  std::vector<Guess> kept;
  std::vector<int> counts(index.models().size(), 0);
  for (auto& guess : guesses) {
    if (static_cast<int>(kept.size()) == limit) break;
    if (counts[guess.model]++ < of_one) kept.push_back(std::move(guess));
  }
  return kept;
}

/// How promising an agreement is, 0 to 1.
double promiseOf(const Agreement& agreement, double tolerance) {
  return agreement.score(tolerance) * (1 - HIDDEN_COST * agreement.hidden);
}

/// Holds a guess against some points and the picture, in shape.
void judge(Guess& guess, const PlanarSurface& probes, const Observation& observation,
           const ModelIndex& index, double tolerance) {
  guess.agreement =
      agreementOf(index, guess.model, guess.T_camera_object, probes, observation, tolerance);
  guess.promise = promiseOf(guess.agreement, tolerance);
}

/// Hands guesses out, the most promising first. Colours only take away from a promise: they are not
/// compared before it is a guess's turn by its shape.
class Ranking {
 public:
  Ranking(std::vector<Guess> guesses, const ColoredPoints& colored, const ModelIndex& index)
      : guesses_(std::move(guesses)), colored_(colored), index_(index) {
    std::make_heap(guesses_.begin(), guesses_.end(), isLess);
  }

  bool empty() const { return guesses_.empty(); }

  Guess take() {
    while (!guesses_.front().has_color) {
      Guess guess = pop();
      guess.agreement.color =
          bestColorLikeness(index_, guess.model, guess.T_camera_object, colored_, FINE);
      guess.promise = promiseOf(guess.agreement, FINE);
      guess.has_color = true;
      guesses_.push_back(guess);
      std::push_heap(guesses_.begin(), guesses_.end(), isLess);
    }
    return pop();
  }

 private:
  static bool isLess(const Guess& a, const Guess& b) { return a.promise < b.promise; }

  Guess pop() {
    std::pop_heap(guesses_.begin(), guesses_.end(), isLess);
    const Guess guess = guesses_.back();
    guesses_.pop_back();
    return guess;
  }

  std::vector<Guess> guesses_;
  const ColoredPoints& colored_;
  const ModelIndex& index_;
};

/// The most promising guesses, after a few steps of ICP. `points`: what they are to explain;
/// `cluster`: what ICP moves them onto.
std::vector<Candidate> mostPromising(std::vector<Guess> guesses, const Surface& points,
                                     const Surface& cluster, const Observation& observation,
                                     const ModelIndex& index, const MatchOptions& options) {
  const PlanarSurface few = thinned(points, FEW_PROBES), probes = thinned(points, PROBES),
                      source = thinned(cluster, 2 * PROBES);
  for (auto& guess : guesses)
    guess.promise = closenessOf(index, guess.model, guess.T_camera_object, few, COARSE);
  guesses = best(std::move(guesses), MAX_JUDGED, MAX_JUDGED, index);
  for (auto& guess : guesses) judge(guess, probes, observation, index, COARSE);
  guesses = best(std::move(guesses), MAX_ALIGNED, MAX_ALIGNED_OF_ONE, index);

  ColoredPoints colored;
  if (options.color) colored = coloredPoints(observation, points.points, PROBES);
  RefineOptions coarse;
  coarse.max_iterations = 8;
  coarse.max_distance = 0.01;
  coarse.min_overlap = 0.05;
  for (auto& guess : guesses) {
    const auto alignment =
        refinePose(source, index.grid(guess.model), guess.T_camera_object, coarse);
    if (alignment) guess.T_camera_object = alignment->T_camera_object;
    judge(guess, probes, observation, index, FINE);
  }
  Ranking ranking(std::move(guesses), colored, index);
  std::vector<Candidate> candidates;
  while (!ranking.empty() && static_cast<int>(candidates.size()) < options.max_candidates) {
    const Guess guess = ranking.take();
    Candidate candidate{index.models()[guess.model].name, guess.distance, guess.promise,
                        guess.T_camera_object};
    const bool known = std::any_of(candidates.begin(), candidates.end(),
                                   [&](const auto& other) { return samePose(other, candidate); });
    if (!known) candidates.push_back(std::move(candidate));
  }
  return candidates;
}

}  // namespace

Found<std::vector<Candidate>> matchCluster(const Surface& cluster, const Observation& observation,
                                           const ModelIndex& index, const MatchOptions& options) {
  using Result = Found<std::vector<Candidate>>;
  checkOptions("match", options);
  if (index.empty()) return Result::none("the database holds no object");
  const auto descriptors = describeSurface(cluster, Eigen::Vector3f::Zero(),
                                           index.descriptorOptions(), splitWords(options.kinds));
  if (descriptors.empty())
    return Result::none(format("the cluster has %.0f sampled points, limit %.0f",
                               static_cast<double>(cluster.size()),
                               index.descriptorOptions().min_points));

  const double extent = extentOf(cluster.points);
  const auto views = posesFromViews(descriptors, extent, index, options);
  std::vector<Guess> guesses;
  for (const auto& pose : views.poses)
    guesses.push_back({pose.model, pose.T_camera_object, pose.distance});
  const auto addStanding = [&](const Surface& points, bool smooth, std::vector<Guess>& to) {
    if (!options.stands || !observation.table) return;
    const Anchor anchor = anchorOf(points, smooth, *observation.table);
    for (std::size_t m = 0; m < index.models().size(); ++m)
      addStandingGuesses(anchor, *observation.table, static_cast<int>(m),
                         index.sparse(static_cast<int>(m)), to);
  };
  addStanding(cluster, false, guesses);
  auto candidates =
      mostPromising(std::move(guesses), cluster, cluster, observation, index, options);

  const bool promising = !candidates.empty() && candidates.front().promise >= LOW_PROMISE;
  if (options.parts && !promising)
    for (const auto& part : smoothRegionsOf(cluster, index.descriptorOptions())) {
      std::vector<Guess> of_part;
      addStanding(part, true, of_part);
      for (auto& candidate :
           mostPromising(std::move(of_part), part, cluster, observation, index, options))
        candidates.push_back(std::move(candidate));
    }
  if (!candidates.empty()) {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.promise > b.promise; });
    return candidates;
  }
  if (views.any_of_size)
    return Result::none(
        format("no view is nearer than %.0f in the descriptor's metric (%.0f compared)",
               options.max_distance, static_cast<double>(descriptors.size())));
  return Result::none(
      format("the cluster is %.2f m across, more than %.1f times any object it looks like", extent,
             options.max_size_ratio));
}

}  // namespace tabletop_perception
