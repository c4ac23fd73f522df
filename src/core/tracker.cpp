#include "tabletop_perception/tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include <Eigen/Cholesky>

namespace tabletop_perception {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double TURN_PER_SHIFT = 10;    // of creeping things [rad/m]
constexpr double CONTRADICTION = 22.46;  // squared Mahalanobis distance, 99.9 % of 6 degrees
constexpr double SEEN_EVENLY = 0.0003;   // error that sightings share and no mean takes out [m]

constexpr double TURNED_ANGLE = 0.5;     // from which on a thing is turned over [rad]
constexpr double TURNED_SHIFT = 0.03;    // from which on it has been moved, besides [m]
constexpr double SUREST_TURN = 0.99;     // that a single sighting can be
constexpr double LEAST_TURN_ODDS = 0.1;  // logarithm, of the turn that a sighting prefers
constexpr double MAX_TURN_ODDS = 8;      // logarithm; more would take a thing long to lose
constexpr double NEW_TURN_ODDS = 8;      // logarithm, that another turn needs

constexpr char UNKNOWN[] = "unknown";  // name of what has none

/// The angle [rad] by which to turn about an axis, after R, to come nearest to no turn at all.
double nearestTurn(const Eigen::Matrix3d& R, const Eigen::Vector3d& axis) {
  const Eigen::Quaterniond q(R);
  return -2 * std::atan2(q.vec().dot(axis), q.w());
}

/// Of the poses at which an object looks as it does at `pose`, the one nearest to `last`.
Eigen::Isometry3d nearestAlike(const Eigen::Isometry3d& pose, const Eigen::Isometry3d& last,
                               const Symmetry& symmetry) {
  std::vector<Eigen::Matrix3d> rotations{Eigen::Matrix3d::Identity()};
  rotations.insert(rotations.end(), symmetry.rotations.begin(), symmetry.rotations.end());
  Eigen::Matrix3d nearest = Eigen::Matrix3d::Identity();
  double least = std::numeric_limits<double>::infinity();
  for (Eigen::Matrix3d rotation : rotations) {
    const Eigen::Matrix3d R_last_object = last.linear().transpose() * pose.linear();
    if (symmetry.continuous()) {
      const double angle = nearestTurn(R_last_object * rotation, symmetry.axis);
      rotation = rotation * Eigen::AngleAxisd(angle, symmetry.axis).toRotationMatrix();
    }
    const double turn = Eigen::AngleAxisd(Eigen::Matrix3d(R_last_object * rotation)).angle();
    if (turn >= least) continue;
    least = turn;
    nearest = rotation;
  }
  Eigen::Isometry3d motion(Eigen::Translation3d(symmetry.center));
  motion.rotate(nearest).translate(-symmetry.center);
  return pose * motion;
}

/// The step from one pose to another: shift of the origin, turn about the frame's axes.
Vector6d stepBetween(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(to.linear() * from.linear().transpose()));
  Vector6d step;
  step << to.translation() - from.translation(), turn.angle() * turn.axis();
  return step;
}

Eigen::Isometry3d stepped(const Eigen::Isometry3d& from, const Vector6d& step) {
  Eigen::Isometry3d to = from;
  to.translation() += step.head<3>();
  const double angle = step.tail<3>().norm();
  if (angle > 0)
    to.linear() =
        Eigen::AngleAxisd(angle, step.tail<3>() / angle).toRotationMatrix() * from.linear();
  return to;
}

PoseCovariance evenCovariance(double shift) {
  const double turn = TURN_PER_SHIFT * shift;
  PoseCovariance covariance = PoseCovariance::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(shift * shift),
      Eigen::Vector3d::Constant(turn * turn);
  return covariance;
}

}  // namespace

/// Counts a sighting for or against the turn that a thing is held in: whether it stays in it,
/// although the sighting says otherwise.
bool Tracker::keepsTurn(Track& track, const std::optional<Eigen::Vector3d>& middle,
                        const Eigen::Isometry3d& pose, const Sighting& sighting) {
  const Eigen::Isometry3d& last = track.thing.T_world_object;
  const double sure = std::min(SUREST_TURN, sighting.turn);
  const double odds = std::max(LEAST_TURN_ODDS, std::log(sure / (1 - sure)));
  // What is seen of a thing is not its middle while something hides a part of it, and its origin
  // need not be near its middle: both have moved where it has.
  double moved = (last.translation() - pose.translation()).norm();
  if (middle && sighting.middle) moved = std::min(moved, (*middle - *sighting.middle).norm());
  if (track.thing.covariance.isZero() || moved > TURNED_SHIFT) {
    track.turn_odds = odds;
    return false;
  }
  const double angle =
      Eigen::AngleAxisd(Eigen::Matrix3d(last.linear().transpose() * pose.linear())).angle();
  if (angle < TURNED_ANGLE) {
    if (sighting.decided) track.turn_odds = std::min(MAX_TURN_ODDS, track.turn_odds + odds);
    return false;
  }
  track.turn_odds -= odds;
  if (track.turn_odds > -NEW_TURN_ODDS) return true;
  track.turn_odds = NEW_TURN_ODDS;
  return false;
}

void Tracker::add(Track& track, double stamp, const Sighting& sighting) const {
  TrackedThing& thing = track.thing;
  const double passed = std::max(0.0, stamp - track.last);
  track.last = stamp;
  track.followed = stamp;
  thing.confirmed = thing.confirmed || stamp - track.first >= options_.confirm;
  const auto middle_before = std::exchange(track.middle, sighting.middle);
  if (sighting.covariance.isZero()) {
    thing.T_world_object = sighting.T_world_object;
    thing.covariance.setZero();
    return;
  }
  const Eigen::Isometry3d pose =
      nearestAlike(sighting.T_world_object, thing.T_world_object, sighting.symmetry);
  if (keepsTurn(track, middle_before, pose, sighting)) {
    thing.covariance += passed * evenCovariance(options_.drift);
    return;
  }
  const PoseCovariance seen = sighting.covariance + evenCovariance(SEEN_EVENLY);
  const PoseCovariance before = thing.covariance + passed * evenCovariance(options_.drift);
  const Vector6d step = stepBetween(thing.T_world_object, pose);
  const Eigen::LDLT<PoseCovariance> sum(before + seen);
  if (thing.covariance.isZero() || step.dot(sum.solve(step)) > CONTRADICTION) {
    thing.T_world_object = pose;
    thing.covariance = seen;
    return;
  }
  // The gain is before * (before + seen)^-1, both symmetric.
  const PoseCovariance gain = sum.solve(before).transpose();
  // Sightings that differ about the axis of a symmetry seem to tell of the turn about it: they do
  // not, and the filter would have the thing spin.
  thing.T_world_object = nearestAlike(stepped(thing.T_world_object, gain * step),
                                      thing.T_world_object, sighting.symmetry);
  const PoseCovariance rest = before - gain * before;
  thing.covariance = (rest + rest.transpose()) / 2;
}

std::vector<std::pair<std::size_t, std::size_t>> Tracker::nearestPairs(std::vector<Pair> pairs) {
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
  std::set<std::size_t> tracks, sightings;  // that are taken
  std::vector<std::pair<std::size_t, std::size_t>> nearest;
  for (const auto& [distance, t, s] : pairs) {
    if (tracks.count(t) > 0 || sightings.count(s) > 0) continue;
    tracks.insert(t);
    sightings.insert(s);
    nearest.emplace_back(t, s);
  }
  return nearest;
}

/// How far from where it was last a thing may be.
double Tracker::reachOf(const Track& track) const {
  return options_.max_step + options_.max_speed * std::max(0.0, previous_ - track.followed);
}

/// How far a thing of the same name would have moved.
double Tracker::distanceBetween(const Track& track, const Sighting& sighting) const {
  // Symmetric things turn about their centre, not about the origin of their frame.
  const Eigen::Vector3d& center = sighting.symmetry.center;
  const double moved =
      (track.thing.T_world_object * center - sighting.T_world_object * center).norm();
  if (!track.middle || !sighting.middle) return moved;
  return std::min(moved, (*track.middle - *sighting.middle).norm());
}

/// Moves the middles of named things that this frame does not show to those of unknown ones.
void Tracker::followUnnamed(const std::vector<Sighting>& sightings) {
  std::vector<Pair> pairs;
  for (std::size_t t = 0; t < tracks_.size(); ++t)
    for (std::size_t s = 0; s < sightings.size(); ++s) {
      const Track& track = tracks_[t];
      if (track.thing.name == UNKNOWN || track.last >= stamp_ || !track.middle ||
          sightings[s].name != UNKNOWN || !sightings[s].middle)
        continue;
      const double distance = (*track.middle - *sightings[s].middle).norm();
      if (distance <= reachOf(track)) pairs.push_back({distance, t, s});
    }
  for (const auto& [t, s] : nearestPairs(std::move(pairs))) {
    tracks_[t].middle = sightings[s].middle;
    tracks_[t].followed = stamp_;
  }
}

std::vector<TrackedThing> Tracker::update(double stamp, const std::vector<Sighting>& sightings) {
  for (auto& track : tracks_) {
    const double back = std::max(0.0, track.last - stamp);
    track.first -= back;
    track.last -= back;
    track.followed -= back;
  }
  previous_ = std::min(stamp_, stamp);
  stamp_ = stamp;
  const auto forgotten = [&](const Track& track) { return stamp - track.last > options_.memory; };
  tracks_.erase(std::remove_if(tracks_.begin(), tracks_.end(), forgotten), tracks_.end());

  std::vector<Pair> pairs;
  for (std::size_t t = 0; t < tracks_.size(); ++t)
    for (std::size_t s = 0; s < sightings.size(); ++s) {
      if (tracks_[t].thing.name != sightings[s].name) continue;
      const double distance = distanceBetween(tracks_[t], sightings[s]);
      if (distance <= reachOf(tracks_[t])) pairs.push_back({distance, t, s});
    }
  constexpr std::size_t NONE = static_cast<std::size_t>(-1);
  std::vector<std::size_t> track_of(sightings.size(), NONE);
  for (const auto& [t, s] : nearestPairs(std::move(pairs))) track_of[s] = t;
  std::vector<TrackedThing> things;
  for (std::size_t s = 0; s < sightings.size(); ++s) {
    if (track_of[s] == NONE) {
      track_of[s] = tracks_.size();
      Track track{{}, stamp, stamp, {}, stamp};
      track.thing.id = next_id_++;
      track.thing.name = sightings[s].name;
      track.thing.T_world_object = sightings[s].T_world_object;
      tracks_.push_back(track);
    }
    add(tracks_[track_of[s]], stamp, sightings[s]);
    things.push_back(tracks_[track_of[s]].thing);
  }
  followUnnamed(sightings);
  return things;
}

std::vector<TrackedThing> Tracker::missed() const {
  std::vector<TrackedThing> missed;
  for (const auto& track : tracks_)
    if (track.thing.confirmed && track.last < stamp_ && stamp_ - track.last <= options_.grace)
      missed.push_back(track.thing);
  return missed;
}

}  // namespace tabletop_perception
