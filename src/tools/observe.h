#pragma once

#include <string>
#include <vector>

#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>

#include "observed.h"

namespace tabletop_perception::tools {

/// Looks at a running graph for some seconds: asks the master and the parameter server, listens to
/// the camera, to tf and to what the stages answer, which wakes up a graph that sleeps.
/// `topic`: of the camera; empty: what the filter in `ns` listens to.
Observed observeGraph(const std::string& ns, const std::string& topic, double seconds);

/// Looks at a whole bag. `topic`: of the camera; empty: the only one with clouds. The points of a
/// few clouds are looked at, and whether the defaults find a table there. Throws
/// std::invalid_argument for a bag that cannot be read, or with several such topics.
Observed observeBag(const std::string& file, const std::string& topic);

/// What a message shows besides its points.
CloudSeen cloudSeen(const sensor_msgs::PointCloud2& message);

/// What its points show.
PointsSeen pointsSeen(const sensor_msgs::PointCloud2& message);

/// Collects transforms from /tf and /tf_static.
class TransformCollector {
 public:
  /// `arrival`: of the message, by the clock that stamps should follow; none: it stands still.
  void add(const tf2_msgs::TFMessage& message, bool is_static, std::optional<double> arrival);

  /// All of them, after `seconds` of listening.
  std::map<std::string, TransformSeen> seen(double seconds) const;

 private:
  struct Link {
    std::string parent;
    bool is_static;
    int messages = 0;
    std::vector<double> lags;
  };
  std::map<std::string, Link> links_;
};

/// Of the topics with camera_info messages, the one that shares most of its name with the clouds';
/// empty: there is none in the same camera's namespace.
std::string cameraInfoOf(const std::string& clouds, const std::map<std::string, TopicSeen>& topics);

}  // namespace tabletop_perception::tools
