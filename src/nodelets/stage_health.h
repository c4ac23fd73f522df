#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/time.h>

namespace tabletop_perception {

/// What /diagnostics says of a stage: how often it answers, how late, what it drops and why, and
/// the reason it gave last. From any thread.
class StageHealth {
 public:
  /// A frame that was answered: stamped by the camera at `stamp`, worked on for `work`.
  void answered(const ros::Time& stamp, std::chrono::nanoseconds work);
  /// A frame that was not, and why.
  void dropped(const std::string& cause);
  /// Why the last frame came out without something; empty if it did not.
  void setReason(const std::string& reason);
  /// Anything else of the stage, shown as it is until it changes.
  void setValue(const std::string& name, const std::string& value);
  /// A stage that nobody listens to sleeps.
  void setAwake(bool awake);

  /// Figures since the last call, counts of what was dropped since the start.
  void fill(diagnostic_updater::DiagnosticStatusWrapper& status);

 private:
  using Clock = std::chrono::steady_clock;
  struct Window {
    Clock::time_point start = Clock::now();
    int frames = 0, drops = 0;
    double latency_sum = 0, latency_max = 0, work_sum = 0;  ///< [s]
  };

  std::mutex mutex_;
  Window window_;
  std::map<std::string, int> drops_;  ///< by cause
  std::map<std::string, std::string> values_;
  std::string last_drop_, reason_;
  bool awake_ = false;
};

}  // namespace tabletop_perception
