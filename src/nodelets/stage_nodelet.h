#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <dynamic_reconfigure/server.h>
#include <nodelet/nodelet.h>
#include <ros/ros.h>

#include "options_ros.h"
#include "stage_health.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

/// What the nodelets share: options that follow dynamic_reconfigure, parameters that are checked,
/// diagnostics, and subscriptions that last only while somebody wants the results.
///
/// Topics, services and reconfiguration run one after the other on the nodelet's own queue, so the
/// callbacks of one nodelet never overlap. A nodelet whose parameters are wrong says so once and
/// stays silent; its manager lives on.
class StageNodelet : public nodelet::Nodelet {
 protected:
  /// Reads the parameters, then the options, then advertises. May throw: see above.
  virtual void start() = 0;
  /// Opens and closes the inputs.
  virtual void subscribe() = 0;
  virtual void unsubscribe() = 0;
  /// Whether the results are wanted although nobody listens to a topic (tf, a waiting service).
  virtual bool wantedAnyway() { return false; }

  /// A parameter of the nodelet that is no option of its stage; throws std::invalid_argument when
  /// it has another type.
  template <typename T>
  T parameter(const std::string& name, T value) {
    parameters_.insert(name);
    XmlRpc::XmlRpcValue set;
    auto& nh = getPrivateNodeHandle();
    if (nh.getParam(name, set)) readParameter(nh.resolveName(name), set, value);
    return value;
  }

  /// For a nodelet without options: throws std::invalid_argument for a parameter that it does not
  /// know.
  void refuseOtherParameters();

  /// Keeps `options` as the parameters under `nh` and dynamic_reconfigure say. Throws
  /// std::invalid_argument for an unknown parameter, a wrong type, a value out of range or two that
  /// contradict each other; a reconfiguration that does is refused, and the options stay. `changed`
  /// is called after every change.
  template <typename Config, typename Options>
  void serveOptions(const ros::NodeHandle& nh, Options& options,
                    const std::function<void()>& changed = nullptr) {
    XmlRpc::XmlRpcValue set;
    nh.getParam(nh.getNamespace(), set);
    const bool own = nh.getNamespace() == getPrivateNodeHandle().getNamespace();
    checkParameters<Options>(nh.getNamespace(), set, own ? parameters_ : std::set<std::string>());

    auto server = std::make_shared<dynamic_reconfigure::Server<Config>>(nh);
    const auto accepted = std::make_shared<Config>();
    server->setCallback(
        [this, &options, accepted, changed, name = nh.getNamespace()](Config& config, uint32_t) {
          const auto asked = optionsFromConfig<Options>(config);
          try {
            checkFields(name + "/", asked);
          } catch (const std::invalid_argument& error) {
            warn(std::string("not changed: ") + error.what());
            config = *accepted;  // which the server then tells everybody
            return;
          }
          options = asked;
          *accepted = config;
          if (changed) changed();
        });
    servers_.push_back(server);
  }

  /// Keeps `options` as those that another nodelet serves in the namespace `section` beside this
  /// one, also when they are reconfigured. Throws as serveOptions for what is set there.
  template <typename Options>
  void followOptions(const std::string& section, Options& options) {
    ros::NodeHandle nh(getNodeHandle(), section);
    readOptions(getNodeHandle(), section, options);
    followed_.push_back(nh.subscribe<dynamic_reconfigure::Config>(
        "parameter_updates", 1, [&options](const dynamic_reconfigure::ConfigConstPtr& message) {
          options = optionsFromMessage<Options>(*message);
        }));
  }

  /// Advertises under the nodelet's own name; listeners wake the nodelet up.
  template <typename Message>
  ros::Publisher advertise(const std::string& topic) {
    const ros::SubscriberStatusCallback changed = [this](const ros::SingleSubscriberPublisher&) {
      updateSubscriptions();
    };
    publishers_.push_back(
        getPrivateNodeHandle().advertise<Message>(topic, OUTPUT_QUEUE, changed, changed));
    return publishers_.back();
  }

  /// Opens or closes the inputs, as the listeners and wantedAnyway() demand. From any thread.
  void updateSubscriptions();

  /// Works on a frame of the camera's `stamp`; one that throws is skipped with a warning that gives
  /// the reason. Both show in the diagnostics.
  void attempt(const ros::Time& stamp, const std::function<void()>& work);

  /// What else the diagnostics say: frames that are dropped, and why a frame has no result.
  StageHealth& health() { return health_; }

  /// Whether `time` is not before `called`, a moment that is past. Where the clock was set back
  /// since (a bag begins anew), whether it is after that.
  static bool isSince(const ros::Time& called, const ros::Time& time);

  /// Why nothing comes: which of the inputs nobody publishes.
  static std::string inputsReport(const std::vector<ros::Subscriber>& inputs);

  /// A warning that does not flood the log: the same text every 10 s, another after 1 s. From
  /// any thread.
  void warn(const std::string& text);

  /// Frames that wait between two stages. The filter lets no more into the graph than are worked
  /// on, so within one manager nothing is ever lost here.
  static constexpr int INNER_QUEUE = 5;
  /// Incomplete frames that a synchroniser holds: as many as a 30 Hz camera sends during the
  /// second that matching may take when the nodelets are separate processes.
  static constexpr int SYNC_QUEUE = 30;

 private:
  static constexpr int OUTPUT_QUEUE = 5;

  void onInit() final;
  void startDiagnostics();

  std::set<std::string> parameters_;            ///< names of those that are no options
  std::vector<std::shared_ptr<void>> servers_;  ///< dynamic_reconfigure
  std::vector<ros::Subscriber> followed_;       ///< options of other nodelets
  StageHealth health_;
  std::unique_ptr<diagnostic_updater::Updater> diagnostics_;
  ros::WallTimer diagnostics_timer_;

  std::mutex mutex_;  ///< guards what follows
  std::vector<ros::Publisher> publishers_;
  bool started_ = false;
  bool subscribed_ = false;

  std::mutex warning_mutex_;  ///< guards what follows
  std::string last_warning_;
  std::chrono::steady_clock::time_point last_warning_time_;
};

}  // namespace tabletop_perception
