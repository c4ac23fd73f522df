#pragma once

#include <chrono>
#include <map>
#include <string>

namespace tabletop_perception {

/// Measures stages one after the other.
class StopWatch {
 public:
  explicit StopWatch(std::map<std::string, double>& times_ms) : times_ms_(times_ms) {}

  /// Books the time since the last lap under `stage`, on top of what is there.
  void lap(const std::string& stage) {
    const auto now = Clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
    times_ms_[stage] += ms;
    times_ms_["total"] += ms;
    last_ = now;
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::map<std::string, double>& times_ms_;
  Clock::time_point last_ = Clock::now();
};

}  // namespace tabletop_perception
