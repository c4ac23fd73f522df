#include <cmath>

#include "findings.h"

/// What is in the clouds, and where tf says that they are.
namespace tabletop_perception::tools {
namespace {

constexpr double MILLIMETRES = 100;  ///< a median range beyond this is no room's [m]
constexpr double TOO_SMALL = 0.02;   ///< nor can a depth camera see this near [m]
constexpr double CONE = 0.8;         ///< least length of a camera's mean direction of view
constexpr double ALONG_AXIS = 0.9;   ///< cosine of its angle to the axis it looks along
constexpr double MOST = 0.5;         ///< share of points
constexpr double TF_AHEAD = 2;       ///< of transforms before the clouds [s]

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.npos, end) == 0;
}

/// The link of a camera's body, x forward by REP 103. Not of the robot or the room: clouds that
/// were moved there may lie in any direction.
bool isCameraBody(const std::string& frame) {
  for (const char* other : {"optical", "base", "robot", "world", "map", "odom", "table", "ground"})
    if (frame.find(other) != frame.npos) return false;
  return endsWith(frame, "_link") || endsWith(frame, "_frame");
}

/// The axis that a camera at the origin looks along, 0, 1 or 2; -1: none.
int viewAxis(const PointsSeen& points) {
  const double length = points.direction.norm();
  int axis;
  const double along = points.direction.maxCoeff(&axis);
  return length > CONE && along > ALONG_AXIS * length ? axis : -1;
}

void checkViewAxis(const PointsSeen& points, const std::string& frame, const std::string& input,
                   Findings& findings) {
  const int axis = viewAxis(points);
  if (frame.find("optical") != frame.npos && axis == 0)
    findings.error("optical_mixup",
                   "clouds on " + input + " look along x, but are in " + frame +
                       ": an optical frame has z forward and y down; publish them in the camera's "
                       "link, or turn them");
  if (isCameraBody(frame) && axis == 2)
    findings.error("optical_mixup",
                   "clouds on " + input + " look along z, but are in " + frame +
                       ": a link has x forward and z up; publish them in the camera's "
                       "*_optical_frame");
}

/// Share of the points that are nearer than a limit.
double shareNearer(const PointsSeen& points, double limit) {
  const auto end = std::lower_bound(points.ranges.begin(), points.ranges.end(), limit);
  return static_cast<double>(end - points.ranges.begin()) / points.ranges.size();
}

std::string percent(double share) { return std::to_string(std::lround(100 * share)) + " %"; }

void checkRange(const Observed& seen, const PointsSeen& points, Findings& findings) {
  const double middle = points.ranges[points.ranges.size() / 2];
  const auto half = "half of the points on " + seen.input + " are farther than ";
  if (middle > MILLIMETRES) {
    findings.error("depth_millimetres", half + figure(middle) + " m: that is " +
                                            figure(middle / 1000) +
                                            " m in millimetres; coordinates must be metres");
    return;
  }
  if (middle < TOO_SMALL) {
    findings.error("depth_too_small", half + "no more than " + figure(middle) +
                                          " m: was a depth in metres taken for millimetres? "
                                          "Coordinates must be metres");
    return;
  }
  // A wall behind the table is no fault as long as the table is found.
  if (!seen.tables || seen.tables->found > 0) return;
  const double beyond = 1 - shareNearer(points, seen.filter.max_range);
  const double before = shareNearer(points, seen.filter.min_range);
  if (beyond > MOST)
    findings.error("table_behind_crop", percent(beyond) + " of the points on " + seen.input +
                                            " are beyond filter.max_range of " +
                                            figure(seen.filter.max_range) +
                                            " m and no table is found; the middle one is at " +
                                            figure(middle) + " m: set max_range behind the table");
  if (before > MOST)
    findings.error("table_before_crop",
                   percent(before) + " of the points on " + seen.input +
                       " are nearer than filter.min_range of " + figure(seen.filter.min_range) +
                       " m and no table is found; the middle one is at " + figure(middle) +
                       " m: set min_range before the table, or take the camera back");
}

/// The frames from one to the root of its tree, itself first.
std::vector<std::string> pathToRoot(const Observed& seen, std::string frame) {
  std::vector<std::string> path{frame};
  for (auto link = seen.transforms.find(frame);
       link != seen.transforms.end() && path.size() <= seen.transforms.size();
       link = seen.transforms.find(frame))
    path.push_back(frame = link->second.parent);
  return path;
}

bool inTf(const Observed& seen, const std::string& frame) {
  return seen.transforms.count(frame) > 0 ||
         std::any_of(seen.transforms.begin(), seen.transforms.end(),
                     [&](const auto& link) { return link.second.parent == frame; });
}

/// The frames whose transforms lead from one to another, or to the root where no other is asked
/// for; empty: there is no way.
std::optional<std::vector<std::string>> linksBetween(const Observed& seen, const std::string& from,
                                                     const std::string& to) {
  auto path = pathToRoot(seen, from);
  if (to.empty()) return path;
  auto other = pathToRoot(seen, to);
  if (path.back() != other.back()) return std::nullopt;
  while (!path.empty() && !other.empty() && path.back() == other.back())
    path.pop_back(), other.pop_back();
  path.insert(path.end(), other.begin(), other.end());
  return path;
}

void checkTransformTimes(const Observed& seen, const std::vector<std::string>& frames,
                         double timeout, Findings& findings) {
  const auto lag = cloudLag(seen);
  if (!lag || findings.any({"stamp_zero", "sim_time_without_clock", "stamp_future", "stamp_old"}))
    return;
  for (const auto& frame : frames) {
    const auto link = seen.transforms.find(frame);
    if (link == seen.transforms.end() || link->second.is_static || !link->second.lag) continue;
    const double later = *link->second.lag - *lag;
    const auto name = "transform " + link->second.parent + " -> " + frame + " is ";
    if (later > timeout + link->second.interval)
      findings.error("tf_past", name + figure(later) + " s behind the clouds of " + seen.input +
                                    ", limit " + figure(timeout) +
                                    " (up_timeout): its node is slow or its clock late");
    if (later < -TF_AHEAD)
      findings.error("tf_future", name + figure(-later) + " s ahead of the clouds of " +
                                      seen.input + ", limit " + figure(TF_AHEAD) +
                                      ": the clocks of two machines differ, or it is left over "
                                      "from before a bag began anew");
  }
}

}  // namespace

void checkPoints(const Observed& seen, Findings& findings) {
  if (seen.clouds.empty() || seen.points.empty()) return;
  const auto& cloud = seen.clouds.back();
  const auto& points = seen.points.back();

  std::vector<std::string> missing;
  for (const char* name : {"x", "y", "z"})
    if (std::find(points.fields.begin(), points.fields.end(), name) == points.fields.end())
      missing.push_back(name);
  if (!missing.empty()) {
    findings.error("cloud_fields", "clouds on " + seen.input + " lack the fields " +
                                       listOf(missing) + ", there are [" + listOf(points.fields) +
                                       "]: must have x, y and z as floats");
    return;
  }
  if (!points.unreadable.empty()) {
    findings.error("cloud_unreadable", "clouds on " + seen.input +
                                           " cannot be read: " + points.unreadable +
                                           "; the node that publishes them has to be mended");
    return;
  }
  if (points.pixels == 0) {
    findings.error("cloud_empty", "clouds on " + seen.input + " are " +
                                      std::to_string(cloud.width) + " x " +
                                      std::to_string(cloud.height) +
                                      " points: must have some; does a filter before drop all?");
    return;
  }
  if (points.ranges.empty()) {
    findings.error("cloud_all_nan", "all " + std::to_string(points.pixels) + " points on " +
                                        seen.input +
                                        " are NaN: is the lens covered, the infrared light off, "
                                        "the scene nearer than the camera can see?");
    return;
  }
  if (cloud.height <= 1)
    findings.warning("cloud_unorganized",
                     "clouds on " + seen.input + " are " + std::to_string(cloud.width) + " x " +
                         std::to_string(cloud.height) +
                         ", unorganised: slower and blind at edges; must be width x height of the "
                         "picture (the driver's registered points, before any voxel grid)");
  checkViewAxis(points, cloud.frame_id, seen.input, findings);
  checkRange(seen, points, findings);
}

void checkTransforms(const Observed& seen, Findings& findings) {
  if (seen.clouds.empty() || findings.any({"frame_empty", "frame_slash"})) return;
  const auto& frame = seen.clouds.back().frame_id;
  const std::string up_frame = seen.graph ? seen.graph->up_frame : "";
  const double timeout = seen.graph ? seen.graph->up_timeout : GraphSeen().up_timeout;
  if (up_frame == frame) return;

  if (seen.transforms.empty()) {
    if (!up_frame.empty())
      findings.error("tf_missing", "nothing came on /tf and /tf_static in " + figure(seen.seconds) +
                                       " s, but up_frame is " + up_frame +
                                       ": somebody must publish the way from it to " + frame);
    return;
  }
  if (!inTf(seen, frame)) {
    findings.error("frame_unknown",
                   "tf does not know the clouds' frame " + frame + "; it knows " +
                       seen.transforms.begin()->second.parent + ", " +
                       seen.transforms.begin()->first +
                       (seen.transforms.size() > 1 ? ", ..." : "") +
                       ": publish where the camera is (static_transform_publisher)");
    return;
  }
  if (!up_frame.empty() && !inTf(seen, up_frame)) {
    findings.error("up_frame_unknown", "tf does not know table/up_frame " + up_frame +
                                           "; the clouds' tree has the root " +
                                           pathToRoot(seen, frame).back() +
                                           ": set up_frame to a frame whose z is up");
    return;
  }
  const auto frames = linksBetween(seen, frame, up_frame);
  if (!frames) {
    findings.error("tf_disconnected", "tf knows " + frame + " and up_frame " + up_frame +
                                          ", but no way between: their roots are " +
                                          pathToRoot(seen, frame).back() + " and " +
                                          pathToRoot(seen, up_frame).back() +
                                          "; one transform between the two trees is missing");
    return;
  }
  checkTransformTimes(seen, *frames, timeout, findings);
}

}  // namespace tabletop_perception::tools
