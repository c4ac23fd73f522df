#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

namespace tabletop_perception {

/// Tells when on the host's clock a frame was taken, from the time that the device gave it: without
/// the jitter of its way here, and alike for images that belong together. The least delayed frames
/// count; towards the others it gives way slowly, because the two clocks drift.
class DeviceClock {
 public:
  /// `device_us`: of the frame [us]; `now`: of the host, when it came [s].
  double onHost(std::uint64_t device_us, double now) {
    constexpr double JUMP = 0.5;     // a clock was set, a file began anew [s]
    constexpr double DRIFT = 0.002;  // share of a difference that one frame makes up for
    const double device = 1e-6 * static_cast<double>(device_us);
    const double offset = now - device;
    if (!offset_ || offset < *offset_ || offset - *offset_ > JUMP)
      offset_ = offset;
    else
      *offset_ += DRIFT * (offset - *offset_);
    return device + *offset_;
  }

 private:
  std::optional<double> offset_;  ///< of the host's clock from the device's [s]
};

}  // namespace tabletop_perception
