#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <thread>

#include <ros/callback_queue.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/CameraInfo.h>
#include <tf2_msgs/TFMessage.h>
#include <xmlrpcpp/XmlRpc.h>

#include "findings.h"
#include "messages.h"
#include "model_source.h"
#include "observe.h"
#include "tabletop_perception/database.h"

namespace tabletop_perception::tools {
namespace {

using Clock = std::chrono::steady_clock;
using XmlRpc::XmlRpcValue;

constexpr std::chrono::milliseconds LOOK_EVERY{400};  ///< at the points of a cloud
constexpr std::chrono::seconds WAKE_UP{2};            ///< for a sleeping graph to open its inputs
constexpr std::chrono::seconds PING{2};               ///< longest wait for a node's answer

/// Which nodes publish and which listen, topic by topic, and of which type the topics are.
struct MasterState {
  std::map<std::string, std::set<std::string>> publishers, subscribers;  ///< nodes by topic
  std::map<std::string, std::string> types;
  std::set<std::string> nodes;
};

std::map<std::string, std::set<std::string>> nodesByTopic(XmlRpcValue& list) {
  std::map<std::string, std::set<std::string>> by_topic;
  for (int i = 0; i < list.size(); ++i)
    for (int j = 0; j < list[i][1].size(); ++j)
      by_topic[std::string(list[i][0])].insert(std::string(list[i][1][j]));
  return by_topic;
}

MasterState askMaster() {
  MasterState state;
  XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  if (ros::master::execute("getSystemState", request, response, payload, false)) {
    state.publishers = nodesByTopic(payload[0]);
    state.subscribers = nodesByTopic(payload[1]);
    auto services = nodesByTopic(payload[2]);
    for (const auto& topics : {state.publishers, state.subscribers, services})
      for (const auto& [topic, nodes] : topics) state.nodes.insert(nodes.begin(), nodes.end());
  }
  if (ros::master::execute("getTopicTypes", request, response, payload, false))
    for (int i = 0; i < payload.size(); ++i)
      state.types[std::string(payload[i][0])] = std::string(payload[i][1]);
  return state;
}

bool startsWith(const std::string& text, const std::string& start) {
  return text.compare(0, start.size(), start) == 0;
}

/// Whether a topic is one of the graph's own; cameras may share its namespace.
bool ownTopic(const std::string& topic, const std::string& ns) {
  for (const auto* nodelet :
       {"filter", "table", "cluster", "match", "refine", "markers", "pick", "manager"})
    if (startsWith(topic, ns + "/" + nodelet + "/")) return true;
  return false;
}

/// The topics that are published outside the graph.
std::map<std::string, TopicSeen> topicsOutside(const MasterState& state, const std::string& ns) {
  std::map<std::string, TopicSeen> topics;
  for (const auto& [name, nodes] : state.publishers) {
    if (ownTopic(name, ns)) continue;
    const auto type = state.types.find(name);
    topics[name] = {type == state.types.end() ? "" : type->second, {nodes.begin(), nodes.end()}};
  }
  return topics;
}

/// What the filter listens to: of the topics outside the graph that its process subscribes to,
/// the one with clouds or, if there is none, the one of a type that no other nodelet takes. Empty:
/// it does not (yet).
std::string filterInput(const MasterState& state, const std::string& ns) {
  static const std::set<std::string> OTHERS{
      "tf2_msgs/TFMessage",     "rosgraph_msgs/Clock",        "bond/Status",
      "sensor_msgs/CameraInfo", "geometry_msgs/PointStamped", "rosgraph_msgs/Log"};
  const auto hosts = state.publishers.find(ns + "/filter/cloud");
  if (hosts == state.publishers.end()) return "";
  std::string other;
  for (const auto& [topic, nodes] : state.subscribers) {
    const bool ours = std::any_of(nodes.begin(), nodes.end(), [&](const std::string& node) {
      return hosts->second.count(node) > 0;
    });
    if (!ours || ownTopic(topic, ns)) continue;
    const auto type = state.types.find(topic);
    if (type != state.types.end() && type->second == CLOUD_TYPE) return topic;
    if (other.empty() && (type == state.types.end() || !OTHERS.count(type->second))) other = topic;
  }
  return other;
}

/// Namespaces other than `ns` with a filter of this package.
std::vector<std::string> otherNamespaces(const MasterState& state, const std::string& ns) {
  const std::string end = "/filter/cloud";
  std::vector<std::string> names;
  for (const auto& [topic, nodes] : state.publishers)
    if (topic.size() > end.size() && topic.substr(topic.size() - end.size()) == end &&
        topic != ns + end &&
        state.publishers.count(topic.substr(0, topic.size() - end.size()) + "/refine/objects"))
      names.push_back(topic.substr(0, topic.size() - end.size()));
  return names;
}

/// Whether a node answers a call. In a thread that may outlive this program's patience: a stopped
/// process takes the call and never answers.
std::future<bool> ping(const std::string& node) {
  auto answer = std::make_shared<std::promise<bool>>();
  auto future = answer->get_future();
  std::thread([node, answer, caller = ros::this_node::getName()] {
    XmlRpcValue request, response, payload;
    request[0] = caller;
    request[1] = node;
    std::string host;
    std::uint32_t port = 0;
    const bool known = ros::master::execute("lookupNode", request, response, payload, false) &&
                       ros::network::splitURI(std::string(payload), host, port);
    bool answers = false;
    if (known) {
      XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
      XmlRpcValue call, result;
      call[0] = caller;
      answers = client.execute("getPid", call, result) && !client.isFault();
      client.close();
    }
    answer->set_value(answers);
  }).detach();
  return future;
}

/// The nodes that this graph needs and that do not answer.
std::vector<std::string> silentNodes(const MasterState& state, const std::string& ns,
                                     const std::string& input) {
  std::set<std::string> needed;
  for (const auto& node : state.nodes)
    if (ownTopic(node + "/", ns)) needed.insert(node);
  for (const auto& [topic, nodes] : state.publishers)
    if (topic == input || ownTopic(topic, ns)) needed.insert(nodes.begin(), nodes.end());
  needed.erase(ros::this_node::getName());

  std::vector<std::pair<std::string, std::future<bool>>> answers;
  for (const auto& node : needed) answers.emplace_back(node, ping(node));
  const auto deadline = Clock::now() + PING;
  std::vector<std::string> silent;
  for (auto& [node, answer] : answers)
    if (answer.wait_until(deadline) != std::future_status::ready || !answer.get())
      silent.push_back(node);
  return silent;
}

DatabaseSeen databaseSeen(const std::string& path) {
  DatabaseSeen seen;
  seen.file = expandHome(path);
  std::error_code ignored;
  seen.exists = std::filesystem::exists(seen.file, ignored);
  if (!seen.exists) return seen;
  try {
    seen.objects = ObjectDatabase(seen.file, ObjectDatabase::Mode::READ).names().size();
  } catch (const DatabaseError& error) {
    seen.error = error.what();
  }
  return seen;
}

/// What the parameter server holds for the graph.
void readParameters(const std::string& ns, GraphSeen& graph, FilterOptions& filter) {
  ros::param::get("/use_sim_time", graph.use_sim_time);
  ros::param::get(ns + "/filter/min_range", filter.min_range);
  ros::param::get(ns + "/filter/max_range", filter.max_range);
  ros::param::get(ns + "/table/up_frame", graph.up_frame);
  ros::param::get(ns + "/table/up_timeout", graph.up_timeout);
  std::vector<double> up;
  ros::param::get(ns + "/table/up", up);
  graph.up_stated = ros::param::has(ns + "/table/pitch") ||
                    std::any_of(up.begin(), up.end(), [](double value) { return value != 0; });
  std::string database;
  if (ros::param::get(ns + "/match/database", database)) graph.database = databaseSeen(database);
}

/// Listens to everything that counts.
class GraphObserver {
 public:
  explicit GraphObserver(const std::string& ns) {
    seen_.graph.emplace();
    seen_.graph->ns = ns;
    seen_.tables.emplace();
    listen<rosgraph_msgs::Clock>("/clock", [this](const auto&) { seen_.clock = true; });
    listen<tf2_msgs::TFMessage>("/tf", [this](const tf2_msgs::TFMessage& message) {
      transforms_.add(message, false, now());
    });
    listen<tf2_msgs::TFMessage>("/tf_static", [this](const tf2_msgs::TFMessage& message) {
      transforms_.add(message, true, now());
    });
    // Listening wakes the graph up where it sleeps.
    listen<TableArray>(ns + "/table/tables", [this](const TableArray& tables) {
      ++seen_.tables->frames;
      if (!tables.tables.empty()) ++seen_.tables->found;
      seen_.tables->reason = tables.reason;
    });
    listen<CandidateArray>(ns + "/match/candidates", [this](const CandidateArray& candidates) {
      ++seen_.graph->candidates;
      seen_.graph->candidates_reason = candidates.reason;
    });
    listen<RecognizedObjectArray>(ns + "/refine/objects",
                                  [this](const RecognizedObjectArray&) { ++seen_.graph->objects; });
  }

  Observed watch(const std::string& topic, double seconds) {
    const auto& ns = seen_.graph->ns;
    MasterState state = askMaster();
    seen_.input = topic;
    for (const auto deadline = Clock::now() + WAKE_UP; seen_.input.empty();) {
      seen_.input = filterInput(state, ns);
      if (!seen_.input.empty() || !state.publishers.count(ns + "/filter/cloud") ||
          Clock::now() > deadline)
        break;
      spin(std::chrono::milliseconds(100));
      state = askMaster();
    }
    seen_.topics = topicsOutside(state, ns);
    seen_.graph->other_ns = otherNamespaces(state, ns);
    for (const auto* stage :
         {"filter/cloud", "table/tables", "cluster/clusters", "match/candidates", "refine/objects"})
      seen_.graph->stages.emplace_back(ns + "/" + stage, state.publishers.count(ns + "/" + stage));
    seen_.graph->silent_nodes = silentNodes(state, ns, seen_.input);
    readParameters(ns, *seen_.graph, seen_.filter);

    const auto input = seen_.topics.find(seen_.input);
    if (input != seen_.topics.end() && input->second.type == CLOUD_TYPE) {
      listen<sensor_msgs::PointCloud2>(
          seen_.input, [this](const sensor_msgs::PointCloud2& message) { onCloud(message); }, 10);
      seen_.camera_info = cameraInfoOf(seen_.input, seen_.topics);
      if (!seen_.camera_info.empty())
        listen<sensor_msgs::CameraInfo>(seen_.camera_info,
                                        [this](const auto&) { ++seen_.camera_infos; });
    }
    const auto start = Clock::now();
    spin(std::chrono::duration<double>(seconds));
    seen_.seconds = std::chrono::duration<double>(Clock::now() - start).count();
    seen_.transforms = transforms_.seen(seen_.seconds);
    return std::move(seen_);
  }

 private:
  template <typename Message, typename Callback>
  void listen(const std::string& topic, const Callback& callback, std::uint32_t queue = 100) {
    subscribers_.push_back(nh_.subscribe<Message>(
        topic, queue,
        [callback](const boost::shared_ptr<const Message>& message) { callback(*message); }));
  }

  /// By the clock that the nodes follow; none while a simulated one stands still.
  static std::optional<double> now() {
    const auto time = ros::Time::now();
    return time.isZero() ? std::nullopt : std::optional(time.toSec());
  }

  static void spin(std::chrono::duration<double> time) {
    for (const auto end = Clock::now() + time; Clock::now() < end;)
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.02));
  }

  void onCloud(const sensor_msgs::PointCloud2& message) {
    seen_.clouds.push_back(cloudSeen(message));
    seen_.clouds.back().arrival = now();
    const auto look = Clock::now();
    if (look - last_look_ < LOOK_EVERY) return;
    last_look_ = look;
    seen_.points = {pointsSeen(message)};
  }

  ros::NodeHandle nh_;
  std::vector<ros::Subscriber> subscribers_;
  Observed seen_;
  TransformCollector transforms_;
  Clock::time_point last_look_;
};

/// roscpp aborts the program without an address, or with one that is none.
void checkMasterAddress() {
  setenv("ROS_MASTER_URI", "http://localhost:11311", 0);
  const std::string address = std::getenv("ROS_MASTER_URI");
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(address, host, port))
    throw std::invalid_argument("ROS_MASTER_URI must be http://HOST:PORT, got '" + address + "'");
}

}  // namespace

Observed observeGraph(const std::string& ns, const std::string& topic, double seconds) {
  checkMasterAddress();
  ros::init(ros::M_string(), "tabletop_doctor",
            ros::init_options::AnonymousName | ros::init_options::NoSigintHandler |
                ros::init_options::NoRosout);
  if (!ros::master::check()) {
    Observed seen;
    seen.source = ros::master::getURI();
    seen.reachable = false;
    return seen;
  }
  auto seen = GraphObserver(ns).watch(topic, seconds);
  seen.source = ros::master::getURI();
  return seen;
}

}  // namespace tabletop_perception::tools
