#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/filter.h"

/// What `tabletop doctor` saw of a running graph or of a bag, in which it then looks for causes.
/// Seconds, metres, bytes.
namespace tabletop_perception::tools {

/// What cameras' clouds have to be.
constexpr char CLOUD_TYPE[] = "sensor_msgs/PointCloud2";

/// A topic that somebody publishes or, in a bag, that has messages.
struct TopicSeen {
  std::string type;                     ///< package/Message
  std::vector<std::string> publishers;  ///< names of nodes; of a bag: none
};

/// One message of the camera's topic.
struct CloudSeen {
  double stamp = 0;               ///< of its header
  std::optional<double> arrival;  ///< by the clock that stamps should follow, or when it was
                                  ///< recorded; none: the clock stands still
  std::uint32_t seq = 0;          ///< counted by the publisher; always 0: it does not count
  std::string frame_id;
  std::uint32_t width = 0, height = 0;
  std::size_t bytes = 0;
};

/// The points of one of these messages.
struct PointsSeen {
  std::vector<std::string> fields;
  std::string unreadable;     ///< why the message is no cloud; empty if it is one
  std::size_t pixels = 0;     ///< with or without a point
  std::vector<float> ranges;  ///< distances of the points from the sensor, ascending
  /// Mean of the unit vectors towards the points: the direction of view, the longer the narrower.
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

/// The transform of one tf frame.
struct TransformSeen {
  std::string parent;
  bool is_static = false;
  std::optional<double> lag;  ///< median of arrival less stamp; none: the clock stands still
  double interval = 0;        ///< between two messages, on average
};

/// The answers of the table stage.
struct TablesSeen {
  int frames = 0;
  int found = 0;       ///< frames with a table
  std::string reason;  ///< of the last frame; empty: something stands on a table
};

/// The file of the trained objects, as this machine sees it.
struct DatabaseSeen {
  std::string file;
  bool exists = false;
  std::string error;  ///< why it cannot be read; empty if it can
  std::size_t objects = 0;
};

/// A running graph.
struct GraphSeen {
  std::string ns;  ///< that its nodelets live in
  /// The topic of each stage that is there for good, in the order of the stages, and whether the
  /// stage advertises it.
  std::vector<std::pair<std::string, bool>> stages;
  std::vector<std::string> other_ns;      ///< where a filter of this package runs, too
  std::vector<std::string> silent_nodes;  ///< registered with the master, but not answering
  bool use_sim_time = false;

  std::string up_frame;    ///< empty: not given
  bool up_stated = false;  ///< by `up` or `pitch`
  double up_timeout = 0.2;

  std::optional<DatabaseSeen> database;  ///< none: `match` has no such parameter
  int candidates = 0;                    ///< frames answered by `match`
  std::string candidates_reason;         ///< of the last one
  int objects = 0;                       ///< frames answered by `refine`
};

/// All of it.
struct Observed {
  std::string source;              ///< the bag's file, or the master's address
  bool reachable = true;           ///< false: no master answers
  double seconds = 0;              ///< watched, or between the bag's first and last message
  std::optional<GraphSeen> graph;  ///< none: a bag
  std::map<std::string, TopicSeen> topics;  ///< without those of the graph itself
  std::string input;                        ///< topic of the camera's clouds; empty: not known
  std::vector<CloudSeen> clouds;            ///< in the order of their arrival
  std::vector<PointsSeen> points;           ///< of some of them
  std::string camera_info;                  ///< the topic that comes with the clouds; empty: none
  int camera_infos = 0;                     ///< messages on it
  std::map<std::string, TransformSeen> transforms;  ///< by the child's name
  bool clock = false;                               ///< messages on /clock
  FilterOptions filter;                             ///< as the graph has them
  std::optional<TablesSeen> tables;                 ///< none: nobody was asked
};

}  // namespace tabletop_perception::tools
