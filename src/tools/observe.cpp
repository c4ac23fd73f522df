#include "observe.h"

#include <algorithm>
#include <stdexcept>

#include "conversions.h"
#include "findings.h"

namespace tabletop_perception::tools {
namespace {

/// tf2 drops a slash in front, as ROS once wrote it.
std::string frameName(const std::string& name) {
  return !name.empty() && name[0] == '/' ? name.substr(1) : name;
}

}  // namespace

CloudSeen cloudSeen(const sensor_msgs::PointCloud2& message) {
  CloudSeen seen;
  seen.stamp = message.header.stamp.toSec();
  seen.seq = message.header.seq;
  seen.frame_id = message.header.frame_id;
  seen.width = message.width;
  seen.height = message.height;
  seen.bytes = message.data.size();
  return seen;
}

PointsSeen pointsSeen(const sensor_msgs::PointCloud2& message) {
  PointsSeen seen;
  for (const auto& field : message.fields) seen.fields.push_back(field.name);
  Cloud cloud;
  try {
    cloud = cloudFromMessage(message);
  } catch (const std::invalid_argument& error) {
    seen.unreadable = error.what();
    return seen;
  }
  seen.pixels = cloud.size();
  for (const int i : validIndices(cloud)) {
    const Eigen::Vector3f point = cloud.point(i);
    const float range = point.norm();
    seen.ranges.push_back(range);
    if (range > 0) seen.direction += (point / range).cast<double>();
  }
  if (!seen.ranges.empty()) seen.direction /= static_cast<double>(seen.ranges.size());
  std::sort(seen.ranges.begin(), seen.ranges.end());
  return seen;
}

void TransformCollector::add(const tf2_msgs::TFMessage& message, bool is_static,
                             std::optional<double> arrival) {
  for (const auto& transform : message.transforms) {
    Link& link = links_[frameName(transform.child_frame_id)];
    link.parent = frameName(transform.header.frame_id);
    link.is_static = is_static;
    ++link.messages;
    if (arrival) link.lags.push_back(*arrival - transform.header.stamp.toSec());
  }
}

std::map<std::string, TransformSeen> TransformCollector::seen(double seconds) const {
  std::map<std::string, TransformSeen> all;
  for (const auto& [child, link] : links_)
    all[child] = {link.parent, link.is_static,
                  link.lags.empty() ? std::nullopt : std::optional(median(link.lags)),
                  seconds / link.messages};
  return all;
}

std::string cameraInfoOf(const std::string& clouds,
                         const std::map<std::string, TopicSeen>& topics) {
  const std::size_t camera = clouds.find('/', 1);  // end of its namespace
  std::string best;
  std::size_t most = camera == clouds.npos ? clouds.size() : camera;
  for (const auto& [name, topic] : topics) {
    if (topic.type != "sensor_msgs/CameraInfo") continue;
    const auto end = std::mismatch(name.begin(), name.end(), clouds.begin(), clouds.end()).first;
    const auto common = static_cast<std::size_t>(end - name.begin());
    if (common > most) {
      most = common;
      best = name;
    }
  }
  return best;
}

}  // namespace tabletop_perception::tools
