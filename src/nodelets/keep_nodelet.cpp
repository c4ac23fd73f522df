#include <algorithm>
#include <csignal>
#include <cstdio>
#include <string>

#include <nodelet/NodeletList.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/NodeletUnload.h>
#include <ros/ros.h>
#include <ros/xmlrpc_manager.h>

/// `keep_nodelet TYPE MANAGER` keeps a nodelet of the name of this node loaded in a manager: also
/// in one that dies and comes back. When it starts it puts a new nodelet in the place of one of
/// that name, when it is asked to end it unloads it. If it is killed the nodelet lives on.
///
/// `nodelet load` learns of a manager's death by a bond, which takes 4 s, and exits; here the
/// connection to the manager tells.
namespace {

constexpr double LOOK_INTERVAL = 0.5;   // [s]
constexpr double MAX_SILENCE = 10.0;    // of the manager, before a warning [s]
constexpr double RETRY_INTERVAL = 2.0;  // after a nodelet that cannot be loaded [s]

volatile std::sig_atomic_t asked_to_end = 0;

void onSignal(int) { asked_to_end = 1; }

/// `rosnode kill`, and a node that takes the name. roscpp would close all connections at once.
void onShutdown(XmlRpc::XmlRpcValue&, XmlRpc::XmlRpcValue& result) {
  asked_to_end = 1;
  result = ros::xmlrpc::responseInt(1, "", 0);
}

class Keeper {
 public:
  Keeper(std::string type, std::string manager)
      : type_(std::move(type)), manager_(std::move(manager)) {}

  /// Loads the nodelet unless the manager has it.
  void look() {
    if (!list_.isValid()) {
      loaded_ = false;
      list_ = nh_.serviceClient<nodelet::NodeletList>(manager_ + "/list", true);
    }
    nodelet::NodeletList present;
    if (!list_.isValid() || !list_.call(present)) {
      list_ = {};  // roscpp may take a client for valid that never got a connection
      warnOfSilence();
      return;
    }
    last_heard_ = ros::WallTime::now();
    const auto& names = present.response.nodelets;
    const bool there = std::find(names.begin(), names.end(), name_) != names.end();
    if (there && loaded_) return;
    if (there) unload();
    loaded_ = load();
    if (loaded_) return;
    ROS_ERROR("%s of type %s cannot be loaded: the log of manager %s says why", name_.c_str(),
              type_.c_str(), nh_.resolveName(manager_).c_str());
    ros::WallDuration(RETRY_INTERVAL).sleep();
  }

  void unload() {
    nodelet::NodeletUnload call;
    call.request.name = name_;
    if (list_.isValid()) ros::service::call(manager_ + "/unload_nodelet", call);
    loaded_ = false;
  }

 private:
  void warnOfSilence() {
    const auto now = ros::WallTime::now();
    if (now - last_heard_ < ros::WallDuration(MAX_SILENCE)) return;
    last_heard_ = now;
    ROS_WARN("%s waits for the nodelet manager %s, which does not answer: is it running?",
             name_.c_str(), nh_.resolveName(manager_).c_str());
  }

  bool load() {
    nodelet::NodeletLoad call;
    call.request.name = name_;
    call.request.type = type_;
    for (const auto& [from, to] : ros::names::getRemappings()) {
      call.request.remap_source_args.push_back(from);
      call.request.remap_target_args.push_back(to);
    }
    return ros::service::call(manager_ + "/load_nodelet", call) && call.response.success;
  }

  const std::string name_ = ros::this_node::getName();
  const std::string type_, manager_;
  ros::NodeHandle nh_;
  ros::ServiceClient list_;  ///< stays connected: what it hears of the manager first is its death
  ros::WallTime last_heard_ = ros::WallTime::now();  ///< of the manager, or when that was said
  bool loaded_ = false;  ///< by this process, into the manager that runs
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "keep_nodelet", ros::init_options::NoSigintHandler);
  if (argc != 3) {
    std::fprintf(stderr, "usage: keep_nodelet TYPE MANAGER [__name:=NAME]\n");
    return 2;
  }
  Keeper keeper(argv[1], argv[2]);
  std::signal(SIGINT, onSignal);
  std::signal(SIGTERM, onSignal);
  ros::XMLRPCManager::instance()->unbind("shutdown");
  ros::XMLRPCManager::instance()->bind("shutdown", onShutdown);

  while (!asked_to_end && ros::ok()) {
    keeper.look();
    ros::WallDuration(LOOK_INTERVAL).sleep();
  }
  keeper.unload();
}
