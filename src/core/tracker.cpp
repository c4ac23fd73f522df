#include "tabletop_perception/tracker.h"

#include <algorithm>

namespace tabletop_perception {
namespace {

struct Pair {
  double distance;
  std::size_t track, sighting;
};

}  // namespace

std::vector<std::uint32_t> Tracker::update(double stamp, const std::vector<Sighting>& sightings) {
  for (auto& track : tracks_) track.stamp = std::min(track.stamp, stamp);
  const auto forgotten = [&](const Track& track) { return stamp - track.stamp > options_.memory; };
  tracks_.erase(std::remove_if(tracks_.begin(), tracks_.end(), forgotten), tracks_.end());

  std::vector<Pair> pairs;
  for (std::size_t t = 0; t < tracks_.size(); ++t)
    for (std::size_t s = 0; s < sightings.size(); ++s) {
      if (tracks_[t].last.name != sightings[s].name) continue;
      const double distance = (tracks_[t].last.position - sightings[s].position).norm();
      if (distance <= options_.max_step) pairs.push_back({distance, t, s});
    }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.distance < b.distance; });

  std::vector<std::uint32_t> ids(sightings.size(), 0);
  std::vector<bool> taken(tracks_.size(), false);
  for (const auto& [distance, t, s] : pairs) {
    if (taken[t] || ids[s]) continue;
    taken[t] = true;
    ids[s] = tracks_[t].id;
    tracks_[t].last = sightings[s];
    tracks_[t].stamp = stamp;
  }
  for (std::size_t s = 0; s < sightings.size(); ++s) {
    if (ids[s]) continue;
    ids[s] = next_id_++;
    tracks_.push_back({ids[s], sightings[s], stamp});
  }
  return ids;
}

}  // namespace tabletop_perception
