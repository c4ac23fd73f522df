/// An OpenNI2 driver whose camera looks at scene::threeObjects(), or at the cloud in the PCD file
/// that the environment variable SYNTHETIC_CLOUD names: depth 640 x 480 [mm] and RGB, 30 Hz,
/// registered. The file that SYNTHETIC_UNPLUGGED names unplugs it while it is there.

#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "scene.h"
#include "tabletop_perception/pcd.h"

// ONI_EXPORT_DRIVER takes these from a header of OpenNI2 that Debian does not ship.
#define XN_NEW(type, ...) new type(__VA_ARGS__)
#define XN_DELETE(pointer) delete (pointer)

namespace tabletop_perception {
namespace {

using namespace std::chrono_literals;

constexpr int FPS = 30;
constexpr int MAX_DEPTH = 10000;  // [mm]
constexpr const char* URI = "synthetic://0";
constexpr const char* SERIAL = "S1701";

const Projection CAMERA = scene::SceneOptions().projection;

float fieldOfView(int pixels, double focal_length) {
  return static_cast<float>(2 * std::atan(pixels / (2 * focal_length)));
}

/// What the camera looks at.
Cloud view() {
  const char* file = std::getenv("SYNTHETIC_CLOUD");
  if (!file) return scene::threeObjects().cloud;
  auto cloud = readPcd(file).cloud;
  if (cloud.width != CAMERA.width || cloud.height != CAMERA.height || cloud.rgb.empty())
    throw std::invalid_argument(std::string(file) + ": not 640 x 480 points with colours");
  return cloud;
}

/// The bytes of one image of either sensor, whichever way the cloud's z axis looks.
std::vector<std::uint8_t> pictureOf(OniSensorType sensor, const Cloud& cloud) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (sensor == ONI_SENSOR_DEPTH) {
      const long depth = cloud.valid(i) ? std::lround(1000 * std::abs(cloud.z[i])) : 0;
      bytes.push_back(static_cast<std::uint8_t>(depth));
      bytes.push_back(static_cast<std::uint8_t>(depth >> 8));
    } else {
      for (const int shift : {16, 8, 0})
        bytes.push_back(static_cast<std::uint8_t>(cloud.rgb[i] >> shift));
    }
  }
  return bytes;
}

template <typename Value>
OniStatus put(const Value& value, void* data, int* size) {
  if (*size < static_cast<int>(sizeof value)) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(data, &value, sizeof value);
  *size = sizeof value;
  return ONI_STATUS_OK;
}

OniVideoMode modeOf(OniSensorType sensor) {
  return {sensor == ONI_SENSOR_DEPTH ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_RGB888,
          CAMERA.width, CAMERA.height, FPS};
}

class Stream : public oni::driver::StreamBase {
 public:
  Stream(OniSensorType sensor, const std::atomic<bool>& plugged)
      : sensor_(sensor),
        plugged_(plugged),
        mode_(modeOf(sensor)),
        picture_(pictureOf(sensor, view())) {}
  ~Stream() override { stop(); }

  OniStatus start() override {
    if (!runs_.exchange(true)) thread_ = std::thread([this] { run(); });
    return ONI_STATUS_OK;
  }
  void stop() override {
    runs_ = false;
    if (thread_.joinable()) thread_.join();
  }

  OniBool isPropertySupported(int id) override {
    char value[64];
    int size = sizeof value;
    return getProperty(id, value, &size) == ONI_STATUS_OK;
  }

  OniStatus getProperty(int id, void* data, int* size) override {
    const bool depth = sensor_ == ONI_SENSOR_DEPTH;
    switch (id) {
      case ONI_STREAM_PROPERTY_VIDEO_MODE:
        return put(mode_, data, size);
      case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
        return put(fieldOfView(CAMERA.width, CAMERA.fx), data, size);
      case ONI_STREAM_PROPERTY_VERTICAL_FOV:
        return put(fieldOfView(CAMERA.height, CAMERA.fy), data, size);
      case ONI_STREAM_PROPERTY_STRIDE:
        return put(stride(), data, size);
      case ONI_STREAM_PROPERTY_MIRRORING:
        return put(mirror_.load(), data, size);
      case ONI_STREAM_PROPERTY_CROPPING:
        return put(OniCropping{}, data, size);
      case ONI_STREAM_PROPERTY_MAX_VALUE:
        return depth ? put(MAX_DEPTH, data, size) : ONI_STATUS_NOT_SUPPORTED;
      case ONI_STREAM_PROPERTY_MIN_VALUE:
        return depth ? put(0, data, size) : ONI_STATUS_NOT_SUPPORTED;
      default:
        return ONI_STATUS_NOT_SUPPORTED;
    }
  }

  OniStatus setProperty(int id, const void* data, int) override {
    if (id == ONI_STREAM_PROPERTY_MIRRORING) {
      mirror_ = *static_cast<const OniBool*>(data);
      return ONI_STATUS_OK;
    }
    const bool same_mode =
        id == ONI_STREAM_PROPERTY_VIDEO_MODE && std::memcmp(data, &mode_, sizeof mode_) == 0;
    return same_mode ? ONI_STATUS_OK : ONI_STATUS_NOT_SUPPORTED;
  }

  /// Called before a recording: what is not raised here is not in the file, and without cropping
  /// its replay has no frames.
  void notifyAllProperties() override {
    for (const int id : {ONI_STREAM_PROPERTY_VIDEO_MODE, ONI_STREAM_PROPERTY_HORIZONTAL_FOV,
                         ONI_STREAM_PROPERTY_VERTICAL_FOV, ONI_STREAM_PROPERTY_STRIDE,
                         ONI_STREAM_PROPERTY_MIRRORING, ONI_STREAM_PROPERTY_CROPPING,
                         ONI_STREAM_PROPERTY_MAX_VALUE, ONI_STREAM_PROPERTY_MIN_VALUE}) {
      char value[64];
      int size = sizeof value;
      if (getProperty(id, value, &size) == ONI_STATUS_OK) raisePropertyChanged(id, value, size);
    }
  }

 private:
  int pixelBytes() const { return sensor_ == ONI_SENSOR_DEPTH ? 2 : 3; }
  int stride() const { return CAMERA.width * pixelBytes(); }

  void run() {
    using Clock = std::chrono::steady_clock;
    const auto period = std::chrono::microseconds(1000000 / FPS);
    for (auto next = Clock::now(); runs_; next += period) {
      std::this_thread::sleep_until(next);
      OniFrame* frame = plugged_ ? getServices().acquireFrame() : nullptr;
      if (!frame) continue;
      const auto now = next.time_since_epoch();
      frame->frameIndex = ++frames_;
      frame->timestamp = std::chrono::duration_cast<std::chrono::microseconds>(now).count();
      frame->sensorType = sensor_;
      frame->videoMode = mode_;
      frame->width = CAMERA.width;
      frame->height = CAMERA.height;
      frame->stride = stride();
      frame->cropOriginX = frame->cropOriginY = 0;
      frame->croppingEnabled = false;
      frame->dataSize = static_cast<int>(picture_.size());
      draw(static_cast<std::uint8_t*>(frame->data));
      raiseNewFrame(frame);
      getServices().releaseFrame(frame);
    }
  }

  void draw(std::uint8_t* to) const {
    if (!mirror_) {
      std::memcpy(to, picture_.data(), picture_.size());
      return;
    }
    const int bytes = pixelBytes();
    for (int v = 0; v < CAMERA.height; ++v)
      for (int u = 0; u < CAMERA.width; ++u)
        std::memcpy(to + v * stride() + u * bytes,
                    &picture_[v * stride() + (CAMERA.width - 1 - u) * bytes], bytes);
  }

  const OniSensorType sensor_;
  const std::atomic<bool>& plugged_;
  const OniVideoMode mode_;
  const std::vector<std::uint8_t> picture_;
  std::atomic<OniBool> mirror_{true};  // as the devices of PrimeSense begin
  std::atomic<bool> runs_{false};
  int frames_ = 0;
  std::thread thread_;
};

class Device : public oni::driver::DeviceBase {
 public:
  explicit Device(const std::atomic<bool>& plugged) : plugged_(plugged) {}

  OniStatus getSensorInfoList(OniSensorInfo** sensors, int* count) override {
    *sensors = sensors_;
    *count = 2;
    return ONI_STATUS_OK;
  }
  oni::driver::StreamBase* createStream(OniSensorType sensor) override {
    return new Stream(sensor, plugged_);
  }
  void destroyStream(oni::driver::StreamBase* stream) override { delete stream; }

  OniBool isImageRegistrationModeSupported(OniImageRegistrationMode) override { return true; }
  OniBool isPropertySupported(int id) override {
    return id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION || id == ONI_DEVICE_PROPERTY_SERIAL_NUMBER;
  }
  OniStatus getProperty(int id, void* data, int* size) override {
    if (id == ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return put(registration_, data, size);
    if (id != ONI_DEVICE_PROPERTY_SERIAL_NUMBER) return ONI_STATUS_NOT_SUPPORTED;
    const std::string serial = SERIAL;
    if (*size <= static_cast<int>(serial.size())) return ONI_STATUS_BAD_PARAMETER;
    *size = static_cast<int>(serial.size()) + 1;
    std::memcpy(data, serial.c_str(), *size);
    return ONI_STATUS_OK;
  }
  OniStatus setProperty(int id, const void* data, int) override {
    if (id != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) return ONI_STATUS_NOT_SUPPORTED;
    registration_ = *static_cast<const OniImageRegistrationMode*>(data);
    return ONI_STATUS_OK;
  }

 private:
  const std::atomic<bool>& plugged_;
  OniVideoMode modes_[2] = {modeOf(ONI_SENSOR_DEPTH), modeOf(ONI_SENSOR_COLOR)};
  OniSensorInfo sensors_[2] = {{ONI_SENSOR_DEPTH, 1, &modes_[0]},
                               {ONI_SENSOR_COLOR, 1, &modes_[1]}};
  OniImageRegistrationMode registration_ = ONI_IMAGE_REGISTRATION_OFF;
};

class Driver : public oni::driver::DriverBase {
 public:
  explicit Driver(OniDriverServices* services) : DriverBase(services) {
    std::strcpy(info_.uri, URI);
    std::strcpy(info_.vendor, "tabletop_perception");
    std::strcpy(info_.name, "synthetic camera");
  }

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback changed, void* cookie) override {
    DriverBase::initialize(connected, disconnected, changed, cookie);
    update();
    thread_ = std::thread([this] {
      for (; runs_; std::this_thread::sleep_for(20ms)) update();
    });
    return ONI_STATUS_OK;
  }
  void shutdown() override {
    runs_ = false;
    if (thread_.joinable()) thread_.join();
  }

  oni::driver::DeviceBase* deviceOpen(const char* uri, const char*) override {
    return plugged_ && std::strcmp(uri, URI) == 0 ? new Device(plugged_) : nullptr;
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }

 private:
  void update() {
    const char* file = std::getenv("SYNTHETIC_UNPLUGGED");
    const bool plugged = !file || !std::filesystem::exists(file);
    if (plugged_.exchange(plugged) == plugged) return;
    plugged ? deviceConnected(&info_) : deviceDisconnected(&info_);
  }

  OniDeviceInfo info_{};
  std::atomic<bool> plugged_{false}, runs_{true};
  std::thread thread_;
};

}  // namespace
}  // namespace tabletop_perception

ONI_EXPORT_DRIVER(tabletop_perception::Driver)
