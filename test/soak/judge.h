#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "pose_jitter.h"
#include "true_poses.h"

namespace tabletop_perception::soak {

/// A thing of an answer, or a tf frame, at the place that was given for it.
struct PlacedThing {
  std::string name;  ///< of the object, or "unknown"
  std::uint32_t id = 0;
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
};

/// A cloud that the camera sent, and what came of it.
struct OfferedCloud {
  double stamp = 0;         ///< [s]
  std::size_t picture = 0;  ///< that it showed
  /// When the objects that it shows came here, on the clock of the stamp [s]; none: it was dropped.
  std::optional<double> answered;
  std::vector<PlacedThing> objects;  ///< of the answer
  std::vector<PlacedThing> frames;   ///< of tf with its stamp
};

/// What the camera saw, by picture.
using Truth = std::vector<std::vector<tools::TrueObject>>;

/// How the objects' shapes are measured, by name.
using Models = std::map<std::string, ReferenceModel>;

struct JudgeOptions {
  double grace = 0.5;        ///< how long the frame of what is gone may stay [s]
  double min_visible = 0.5;  ///< of an object at rest that is to have a frame
};

/// How a run came out.
struct Verdict {
  std::size_t offered = 0;                  ///< clouds
  std::size_t answered = 0;                 ///< of them
  double latency_p50 = 0, latency_p99 = 0;  ///< from stamp to arrival of the answer [s]

  std::size_t id_switches = 0;  ///< an object that was there all the time got another id
  std::size_t frames = 0;       ///< tf frames of named objects that were sent
  std::size_t wrong = 0;      ///< at least a tenth of the diameter off an object at rest (MSSD), or
                              ///< of something that was never there
  std::size_t stale = 0;      ///< of what is gone for longer than the time of grace
  std::size_t flickers = 0;   ///< the frame of an object in plain view was there, and then was not
  std::size_t flips = 0;      ///< right frames of an object at rest, turned by over 30 degrees from
                              ///< the one before: symmetric poses count
  std::size_t due = 0;        ///< objects at rest in plain view, over all answers
  std::size_t shown = 0;      ///< of them with a right frame
  tools::Spread shift, turn;  ///< right frames of objects at rest, from their means [m, rad]
  std::map<std::string, tools::Deviations> rests;  ///< the same, by object

  std::vector<std::string> faults;  ///< each switch, flicker, wrong and stale frame, in words
};

/// Holds what came of the clouds, in the order of their stamps, against the truth. Objects of one
/// name must not be there twice at a time.
Verdict judge(const std::vector<OfferedCloud>& clouds, const Truth& truth, const Models& models,
              const JudgeOptions& options);

}  // namespace tabletop_perception::soak
