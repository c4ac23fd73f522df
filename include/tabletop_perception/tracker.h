#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/model.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct TrackerOptions {
  double max_step = 0.1;   ///< farthest a thing moves between two sightings of it [m]
  double max_speed = 0.3;  ///< and how much farther in each second that it is out of sight [m/s]
  double memory = 5;       ///< how long a thing that is out of sight is remembered [s]
  double confirm = 0.2;    ///< how long a thing is seen before it is confirmed [s]
  double grace = 0.5;      ///< how long a confirmed thing counts as there without being seen [s]
  double drift = 0.001;  ///< how far a thing at rest may creep in a second [m]; turns: 10 rad per m

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("max_step", max_step, Range{0.001, 10});
    visit("max_speed", max_speed, Range{0, 10});
    visit("memory", memory, Range{0, 3600});
    visit("confirm", confirm, Range{0, 60});
    visit("grace", grace, Range{0, 60});
    visit("drift", drift, Range{0, 1});
  }
};

/// Of a pose's error: x, y, z of the origin [m], turns about x, y, z [rad], along the axes of the
/// frame that the pose is in.
using PoseCovariance = Eigen::Matrix<double, 6, 6>;

/// Something seen in a frame.
struct Sighting {
  std::string name;                                    ///< of the object, or "unknown"
  Eigen::Isometry3d T_world_object;                    ///< in the same frame at every call
  PoseCovariance covariance = PoseCovariance::Zero();  ///< zero: not known, nothing is filtered
  Symmetry symmetry;                                   ///< of the object
  std::optional<Eigen::Vector3d> middle;  ///< of what was seen of it, where it is known
  double turn = 1;      ///< probability of its turn, among those in which it looks nearly the same
  bool decided = true;  ///< that turn was decided by this frame, not taken over from the last
};

/// A thing as the tracker knows it.
struct TrackedThing {
  std::uint32_t id = 0;
  std::string name;
  Eigen::Isometry3d T_world_object = Eigen::Isometry3d::Identity();  ///< filtered
  PoseCovariance covariance = PoseCovariance::Zero();
  bool confirmed = false;  ///< seen for long enough
};

/// Gives things ids that stay, and poses that do not tremble.
///
/// A sighting takes over the id of a thing of its name that was seen within `max_step` of it (and
/// `max_speed` times the time that it was out of sight) less than `memory` ago, nearest pairs
/// first; any other is a new thing. Ids count up from 1 and are never used twice, whatever the
/// name. A thing that has lost its name for some frames, in somebody's hand say, is followed
/// meanwhile by the middle of an unknown thing that was no farther away.
///
/// Of poses that look the same the one nearest to the last is taken. A pose is the mean of all
/// sightings by their covariances (a Kalman filter of a thing at rest) until one contradicts it:
/// then the thing has moved, and the mean begins anew. A thing that is where it was but seems to be
/// turned over keeps its pose until much more speaks for the new turn, sighting by sighting, than
/// spoke for the old one (the log odds of both add up).
class Tracker {
 public:
  explicit Tracker(const TrackerOptions& options = {}) : options_(options) {}

  /// What is tracked stays.
  void setOptions(const TrackerOptions& options) { options_ = options; }

  /// The things that a frame's sightings are of, in their order. `stamp`: time of the frame [s];
  /// when it lies before the last one (a bag begins anew), what is remembered counts as seen just
  /// now.
  std::vector<TrackedThing> update(double stamp, const std::vector<Sighting>& sightings);

  /// The confirmed things that the last frame did not show, within their time of grace.
  std::vector<TrackedThing> missed() const;

 private:
  struct Track {
    TrackedThing thing;
    double first, last;                     ///< sighting [s]
    std::optional<Eigen::Vector3d> middle;  ///< of what was seen of it last, under whatever name
    double followed;                        ///< when that was [s]
    double turn_odds = 0;                   ///< logarithm of those for its turn
  };

  struct Pair {
    double distance;  ///< [m]
    std::size_t track, sighting;
  };

  /// One to one, track and sighting, the nearest first.
  static std::vector<std::pair<std::size_t, std::size_t>> nearestPairs(std::vector<Pair> pairs);
  double reachOf(const Track& track) const;
  double distanceBetween(const Track& track, const Sighting& sighting) const;
  void add(Track& track, double stamp, const Sighting& sighting) const;
  static bool keepsTurn(Track& track, const std::optional<Eigen::Vector3d>& middle,
                        const Eigen::Isometry3d& pose, const Sighting& sighting);
  void followUnnamed(const std::vector<Sighting>& sightings);

  TrackerOptions options_;
  std::vector<Track> tracks_;
  double stamp_ = 0;     ///< of the last frame [s]
  double previous_ = 0;  ///< of the one before [s]
  std::uint32_t next_id_ = 1;
};

}  // namespace tabletop_perception
