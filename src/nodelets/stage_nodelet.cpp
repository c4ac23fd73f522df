#include "stage_nodelet.h"

#include <algorithm>
#include <exception>

#include "tabletop_perception/frame_memory.h"

namespace tabletop_perception {

void StageNodelet::onInit() {
  keepFrameMemory();
  parameters_.insert("diagnostic_period");  // of the updater
  try {
    std::lock_guard<std::mutex> lock(mutex_);  // a listener may come before start() is through
    start();
    started_ = true;
  } catch (const std::exception& error) {
    // An exception that leaves onInit would end the manager.
    servers_.clear();
    publishers_.clear();
    NODELET_FATAL("%s is not started: %s", getName().c_str(), error.what());
    return;
  }
  startDiagnostics();
  updateSubscriptions();
}

/// On the process's own queue, so that a stage that hangs is told of, too. The nodelet's queues
/// will not do: one that is unloaded while it works is destroyed after the other of its two queues.
void StageNodelet::startDiagnostics() {
  ros::NodeHandle nh(getPrivateNodeHandle());
  nh.setCallbackQueue(nullptr);
  diagnostics_ = std::make_unique<diagnostic_updater::Updater>(nh, nh, getName());
  diagnostics_->setHardwareID("none");
  diagnostics_->add("frames", [this](auto& status) { health_.fill(status); });
  diagnostics_timer_ =
      nh.createWallTimer(ros::WallDuration(1), [this](const auto&) { diagnostics_->update(); });
}

void StageNodelet::updateSubscriptions() {
  std::lock_guard<std::mutex> lock(mutex_);
  if (!started_) return;
  const auto heard = [](const ros::Publisher& p) { return p.getNumSubscribers() > 0; };
  const bool wanted = wantedAnyway() || std::any_of(publishers_.begin(), publishers_.end(), heard);
  if (wanted == subscribed_) return;
  subscribed_ = wanted;
  health_.setAwake(wanted);
  wanted ? subscribe() : unsubscribe();
}

void StageNodelet::attempt(const ros::Time& stamp, const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  try {
    work();
    health_.answered(stamp, std::chrono::steady_clock::now() - start);
  } catch (const std::exception& error) {
    health_.dropped(error.what());
    warn(std::string("frame skipped: ") + error.what());
  }
}

void StageNodelet::refuseOtherParameters() {
  struct NoOptions {
    void visitFields(const std::function<void(const std::string&, double&)>&) {}
  };
  XmlRpc::XmlRpcValue set;
  const auto& nh = getPrivateNodeHandle();
  nh.getParam(nh.getNamespace(), set);
  checkParameters<NoOptions>(nh.getNamespace(), set, parameters_);
}

bool StageNodelet::isSince(const ros::Time& called, const ros::Time& time) {
  const ros::Time now = ros::Time::now();
  return time >= called || (now < called && time <= now);
}

std::string StageNodelet::inputsReport(const std::vector<ros::Subscriber>& inputs) {
  std::string silent;
  for (const auto& input : inputs)
    if (input && input.getNumPublishers() == 0)
      silent += (silent.empty() ? "nobody publishes " : ", ") + input.getTopic();
  return silent.empty() ? "is the camera publishing?" : silent;
}

void StageNodelet::warn(const std::string& text) {
  using namespace std::chrono_literals;
  std::lock_guard<std::mutex> lock(warning_mutex_);
  const auto now = std::chrono::steady_clock::now();
  const bool first = last_warning_.empty();
  if (!first && now - last_warning_time_ < (text == last_warning_ ? 10s : 1s)) return;
  last_warning_ = text;
  last_warning_time_ = now;
  NODELET_WARN("%s", text.c_str());
}

}  // namespace tabletop_perception
