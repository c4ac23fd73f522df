#include "stage_health.h"

#include <algorithm>
#include <utility>

namespace tabletop_perception {

void StageHealth::answered(const ros::Time& stamp, std::chrono::nanoseconds work) {
  const double latency = (ros::Time::now() - stamp).toSec();
  const std::lock_guard<std::mutex> lock(mutex_);
  ++window_.frames;
  window_.latency_sum += latency;
  window_.latency_max = std::max(window_.latency_max, latency);
  window_.work_sum += std::chrono::duration<double>(work).count();
}

void StageHealth::dropped(const std::string& cause) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++window_.drops;
  ++drops_[cause];
  last_drop_ = cause;
}

void StageHealth::setReason(const std::string& reason) {
  const std::lock_guard<std::mutex> lock(mutex_);
  reason_ = reason;
}

void StageHealth::setValue(const std::string& name, const std::string& value) {
  const std::lock_guard<std::mutex> lock(mutex_);
  values_[name] = value;
}

void StageHealth::setAwake(bool awake) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (awake && !awake_) window_ = Window();  // what was slept through is no silence
  awake_ = awake;
}

void StageHealth::fill(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Status = diagnostic_msgs::DiagnosticStatus;
  const std::lock_guard<std::mutex> lock(mutex_);
  const Window window = std::exchange(window_, Window());
  const double seconds = std::chrono::duration<double>(Clock::now() - window.start).count();
  const double rate = seconds > 0 ? window.frames / seconds : 0;
  if (!awake_)
    status.summary(Status::OK, "asleep: nobody listens");
  else if (window.frames == 0 && window.drops == 0)
    status.summary(Status::WARN, "no frame came");
  else if (window.frames == 0)
    status.summaryf(Status::WARN, "no frame answered: %s", last_drop_.c_str());
  else if (!reason_.empty())
    status.summary(Status::OK, reason_);
  else
    status.summaryf(Status::OK, "%.1f frames per second", rate);

  status.addf("frames per second", "%.2f", rate);
  if (window.frames > 0) {
    status.addf("latency, mean [ms]", "%.1f", 1e3 * window.latency_sum / window.frames);
    status.addf("latency, largest [ms]", "%.1f", 1e3 * window.latency_max);
    status.addf("work, mean [ms]", "%.1f", 1e3 * window.work_sum / window.frames);
  }
  for (const auto& [name, value] : values_) status.add(name, value);
  for (const auto& [cause, count] : drops_) status.addf("dropped: " + cause, "%d", count);
  status.add("last reason", reason_);
}

}  // namespace tabletop_perception
