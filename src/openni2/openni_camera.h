#pragma once

#include <OpenNI.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "openni_options.h"
#include "tabletop_perception/depth_image.h"
#include "tabletop_perception/projection.h"

namespace tabletop_perception {

/// The OpenNI2 library with its drivers, as long as this lives. Throws std::runtime_error.
class OpenniLibrary {
 public:
  OpenniLibrary();
  ~OpenniLibrary();
  OpenniLibrary(const OpenniLibrary&) = delete;
  OpenniLibrary& operator=(const OpenniLibrary&) = delete;
};

/// An image of a camera; `image` points into `frame`.
struct OpenniFrame {
  bool depth = false;         ///< or colour
  PackedImage image;          ///< depth: 16UC1 [mm]; colour: rgb8 or mono8
  Projection camera;          ///< from the field of view that the device states
  std::uint64_t time_us = 0;  ///< on the device's clock, one for both images
  openni::VideoFrameRef frame;
};

/// A camera with depth and perhaps colour, or a file recorded from one. For one thread.
class OpenniCamera : private openni::OpenNI::DeviceDisconnectedListener {
 public:
  /// Opens a device. `device`: empty for the first one, "#N" for the N-th (from 1), the path of an
  /// .oni file, a URI, or a serial number. Throws std::runtime_error that tells what there is when
  /// it is not there, std::invalid_argument when it cannot do what the options ask for.
  OpenniCamera(const std::string& device, const OpenniOptions& options);
  ~OpenniCamera() override;

  const std::string& name() const { return name_; }
  bool hasColor() const { return color_.isValid(); }

  /// Starts and stops the streams.
  void stream(bool depth, bool color);

  /// What can be changed while the streams run. Gives back what the device does not take, or
  /// nothing.
  std::string setExposure(const OpenniOptions& options);

  /// Throws std::runtime_error when the device is gone.
  void checkConnected() const;

  /// The next image of a running stream, none within `timeout`. Throws std::runtime_error when the
  /// device is gone.
  std::optional<OpenniFrame> read(std::chrono::milliseconds timeout);

 private:
  void onDeviceDisconnected(const openni::DeviceInfo* info) override;
  void setModes(const OpenniOptions& options);

  std::string uri_, name_;
  std::atomic<bool> gone_{false};
  bool registered_ = false;
  openni::Device device_;
  openni::VideoStream depth_, color_;
  bool depth_runs_ = false, color_runs_ = false;
};

}  // namespace tabletop_perception
