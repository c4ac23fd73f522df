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
#include "scene_arguments.h"
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
  std::vector<Eigen::Isometry3d> poses;    ///< as they were recognised
  std::vector<Eigen::Isometry3d> tracked;  ///< as the tracker has them
  std::size_t frames = 0;                  ///< of the scene
};

/// How a thing that stands still moves.
struct Jitter {
  Spread translation;  ///< from the mean position [m]
  Spread rotation;     ///< from the mean rotation [rad]
  std::size_t flips = 0;
};

Jitter jitterOf(const std::vector<Eigen::Isometry3d>& poses) {
  const Deviations deviations = deviationsFromMean(poses);
  Jitter jitter{spreadOf(deviations.shifts), spreadOf(deviations.turns), 0};
  for (std::size_t i = 1; i < poses.size(); ++i)
    jitter.flips += angleOf(poses[i - 1].linear().transpose() * poses[i].linear()) > FLIP_ANGLE;
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

using Symmetries = std::map<std::string, Symmetry>;

Symmetries symmetriesIn(const std::string& database) {
  Symmetries symmetries;
  if (database.empty()) return symmetries;
  const ModelIndex index = loadModels(database);
  for (const auto& model : index.models()) symmetries[model.name] = model.symmetry;
  return symmetries;
}

std::vector<Track> tracksOf(const std::string& scene, const std::vector<fs::path>& files,
                            const Symmetries& symmetries) {
  TrackerOptions options;
  options.memory = MEMORY;
  Tracker tracker(options);
  std::map<std::uint32_t, Track> tracks;
  double stamp = 0;
  for (const auto& file : files) {
    const auto objects = readResults(file);
    std::vector<Sighting> sightings;
    for (const auto& object : objects) {
      const auto symmetry = symmetries.find(object.name);
      sightings.push_back({object.name, object.T_camera_object, object.covariance,
                           symmetry == symmetries.end() ? Symmetry() : symmetry->second,
                           object.middle, object.evidence ? object.evidence->turn : 1, true});
    }
    const auto things = tracker.update(stamp += FRAME_TIME, sightings);
    for (std::size_t i = 0; i < objects.size(); ++i) {
      Track& track = tracks[things[i].id];
      track.scene = scene;
      track.name = objects[i].name;
      track.frames = files.size();
      track.poses.push_back(objects[i].T_camera_object);
      track.tracked.push_back(things[i].T_world_object);
    }
  }
  std::vector<Track> all;
  for (auto& [id, track] : tracks) all.push_back(std::move(track));
  return all;
}

ordered_json jitterJson(const Jitter& jitter) {
  const auto spread = [](const Spread& values) {
    return ordered_json{{"mean", values.mean}, {"p95", values.p95}};
  };
  return {{"translation", spread(jitter.translation)},
          {"rotation", spread(jitter.rotation)},
          {"flips", jitter.flips}};
}

void addCells(const Jitter& jitter, std::vector<std::string>& row) {
  constexpr double DEG = 180 / M_PI;
  for (const double shift : {jitter.translation.mean, jitter.translation.p95})
    row.push_back(formatted(shift, 1000, 2));
  for (const double turn : {jitter.rotation.mean, jitter.rotation.p95})
    row.push_back(formatted(turn, DEG, 2));
  row.push_back(std::to_string(jitter.flips));
}

}  // namespace

void evaluateJitter(const fs::path& results, const std::string& database, bool json) {
  const auto symmetries = symmetriesIn(database);
  auto objects = ordered_json::array();
  std::vector<std::vector<std::string>> rows{{"", "seen", "mean mm", "p95 mm", "mean deg",
                                              "p95 deg", "flips", "tracked: mean mm", "p95 mm",
                                              "mean deg", "p95 deg", "flips"}};
  std::size_t flips = 0, tracked_flips = 0;
  for (const auto& [scene, files] : framesIn(results))
    for (const auto& track : tracksOf(scene, files, symmetries)) {
      const Jitter jitter = jitterOf(track.poses), tracked = jitterOf(track.tracked);
      flips += jitter.flips;
      tracked_flips += tracked.flips;
      ordered_json object{{"scene", track.scene},
                          {"name", track.name},
                          {"frames", track.frames},
                          {"seen", track.poses.size()}};
      object.update(jitterJson(jitter));
      object["tracked"] = jitterJson(tracked);
      objects.push_back(object);
      rows.push_back({track.scene + " " + track.name,
                      std::to_string(track.poses.size()) + "/" + std::to_string(track.frames)});
      addCells(jitter, rows.back());
      addCells(tracked, rows.back());
    }
  if (json) {
    const ordered_json all{
        {"objects", objects}, {"flips", flips}, {"tracked_flips", tracked_flips}};
    std::printf("%s\n", all.dump().c_str());
    return;
  }
  printColumns(rows);
  std::printf("flips: %zu as recognised, %zu as tracked\n", flips, tracked_flips);
}

}  // namespace tabletop_perception::tools
