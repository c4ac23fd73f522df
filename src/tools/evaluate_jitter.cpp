#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "evaluate.h"
#include "pose_files.h"
#include "pose_jitter.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/tracker.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr double FLIP_ANGLE = 30 * M_PI / 180;  // from one sighting to the next
constexpr double FRAME_TIME = 0.1;              // [s]
constexpr double MEMORY = 1e6;                  // a thing is never forgotten [s]

/// A thing over the frames of a scene.
struct Track {
  std::string scene, name;
  std::vector<Eigen::Isometry3d> poses;
  std::size_t frames = 0;  ///< of the scene
};

/// How a thing that stands still moves.
struct Jitter {
  Spread translation;  ///< from the mean position [m]
  Spread rotation;     ///< from the mean rotation [rad]
  std::size_t flips = 0;
};

Jitter jitterOf(const Track& track) {
  const Deviations deviations = deviationsFromMean(track.poses);
  Jitter jitter{spreadOf(deviations.shifts), spreadOf(deviations.turns), 0};
  for (std::size_t i = 1; i < track.poses.size(); ++i)
    jitter.flips +=
        angleOf(track.poses[i - 1].linear().transpose() * track.poses[i].linear()) > FLIP_ANGLE;
  return jitter;
}

/// The frames of each scene in their order: SCENE_FRAME.json.
std::map<std::string, std::vector<fs::path>> framesIn(const fs::path& results) {
  std::map<std::string, std::vector<fs::path>> scenes;
  for (const auto& entry : fs::directory_iterator(results)) {
    if (entry.path().extension() != ".json") continue;
    const std::string name = entry.path().stem();
    const auto split = name.rfind('_');
    scenes[split == name.npos ? "" : name.substr(0, split)].push_back(entry.path());
  }
  if (scenes.empty()) throw std::invalid_argument("no SCENE_FRAME.json in " + results.string());
  for (auto& [scene, files] : scenes) std::sort(files.begin(), files.end());
  return scenes;
}

std::vector<Track> tracksOf(const std::string& scene, const std::vector<fs::path>& files) {
  TrackerOptions options;
  options.memory = MEMORY;
  Tracker tracker(options);
  std::map<std::uint32_t, Track> tracks;
  double stamp = 0;
  for (const auto& file : files) {
    const auto objects = readResults(file);
    std::vector<Sighting> sightings;
    for (const auto& object : objects)
      sightings.push_back({object.name, object.T_camera_object, PoseCovariance::Zero(), {}, {}});
    const auto things = tracker.update(stamp += FRAME_TIME, sightings);
    for (std::size_t i = 0; i < objects.size(); ++i) {
      Track& track = tracks[things[i].id];
      track.scene = scene;
      track.name = objects[i].name;
      track.frames = files.size();
      track.poses.push_back(objects[i].T_camera_object);
    }
  }
  std::vector<Track> all;
  for (auto& [id, track] : tracks) all.push_back(std::move(track));
  return all;
}

ordered_json trackJson(const Track& track, const Jitter& jitter) {
  const auto spread = [](const Spread& values) {
    return ordered_json{{"mean", values.mean}, {"p95", values.p95}};
  };
  return {{"scene", track.scene},
          {"name", track.name},
          {"frames", track.frames},
          {"seen", track.poses.size()},
          {"translation", spread(jitter.translation)},
          {"rotation", spread(jitter.rotation)},
          {"flips", jitter.flips}};
}

std::vector<std::string> trackRow(const Track& track, const Jitter& jitter) {
  constexpr double DEG = 180 / M_PI;
  return {track.scene + " " + track.name,
          std::to_string(track.poses.size()) + "/" + std::to_string(track.frames),
          formatted(jitter.translation.mean, 1000, 2),
          formatted(jitter.translation.p95, 1000, 2),
          formatted(jitter.rotation.mean, DEG, 2),
          formatted(jitter.rotation.p95, DEG, 2),
          std::to_string(jitter.flips)};
}

}  // namespace

void evaluateJitter(const fs::path& results, bool json) {
  auto objects = ordered_json::array();
  std::vector<std::vector<std::string>> rows{
      {"", "seen", "mean mm", "p95 mm", "mean deg", "p95 deg", "flips"}};
  std::size_t flips = 0;
  for (const auto& [scene, files] : framesIn(results))
    for (const auto& track : tracksOf(scene, files)) {
      const Jitter jitter = jitterOf(track);
      flips += jitter.flips;
      objects.push_back(trackJson(track, jitter));
      rows.push_back(trackRow(track, jitter));
    }
  if (json) {
    std::printf("%s\n", ordered_json{{"objects", objects}, {"flips", flips}}.dump().c_str());
    return;
  }
  printColumns(rows);
  std::printf("flips: %zu\n", flips);
}

}  // namespace tabletop_perception::tools
