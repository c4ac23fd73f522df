#pragma once

#include <chrono>
#include <string>

namespace tabletop_perception::soak {

/// The number of the process that a node runs in, as the node says; throws std::runtime_error when
/// it does not answer.
int processOf(const std::string& node);

/// Resident memory of a process [MB of 1,000,000 bytes].
double residentMb(int process);

/// The CPU time that a process takes from now on.
class CpuMeter {
 public:
  explicit CpuMeter(int process);

  /// Since the beginning, as a share of one core.
  double share() const;

 private:
  int process_;
  double cpu_;  ///< at the beginning [s]
  std::chrono::steady_clock::time_point start_;
};

}  // namespace tabletop_perception::soak
