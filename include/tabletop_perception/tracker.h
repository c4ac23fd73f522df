#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct TrackerOptions {
  double max_step = 0.1;  ///< farthest a thing moves between two sightings of it [m]
  double memory = 5;      ///< how long a thing that is out of sight is remembered [s]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("max_step", max_step, Range{0.001, 10});
    visit("memory", memory, Range{0, 3600});
  }
};

/// Something seen in a frame.
struct Sighting {
  std::string name;          ///< of the object, or "unknown"
  Eigen::Vector3d position;  ///< in the same frame at every call [m]
};

/// Gives things ids that stay: a sighting takes over the id of a thing of its name that was seen
/// within `max_step` of it less than `memory` ago, nearest pairs first; any other is a new thing.
/// Ids count up from 1 and are never used twice, whatever the name.
class Tracker {
 public:
  explicit Tracker(const TrackerOptions& options = {}) : options_(options) {}

  /// The ids of a frame's sightings, in their order. `stamp`: time of the frame [s]; when it lies
  /// before the last one (a bag begins anew), what is remembered counts as seen just now.
  std::vector<std::uint32_t> update(double stamp, const std::vector<Sighting>& sightings);

 private:
  struct Track {
    std::uint32_t id;
    Sighting last;
    double stamp;  ///< of the last sighting [s]
  };

  TrackerOptions options_;
  std::vector<Track> tracks_;
  std::uint32_t next_id_ = 1;
};

}  // namespace tabletop_perception
