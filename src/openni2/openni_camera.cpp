#include "openni_camera.h"

#include <cctype>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <vector>

namespace tabletop_perception {
namespace {

using openni::PixelFormat;

/// What went wrong, without the end of line that OpenNI puts there.
std::string lastError() {
  std::string text = openni::OpenNI::getExtendedError();
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  return text.empty() ? "no reason given" : text;
}

void check(openni::Status status, const std::string& what) {
  if (status != openni::STATUS_OK) throw std::runtime_error(what + ": " + lastError());
}

std::string serialOf(const openni::Device& device) {
  char serial[256] = "";
  int size = sizeof serial - 1;
  device.getProperty(openni::DEVICE_PROPERTY_SERIAL_NUMBER, serial, &size);
  return serial;
}

std::string serialOf(const std::string& uri) {
  openni::Device device;
  return device.open(uri.c_str()) == openni::STATUS_OK ? serialOf(device) : "";
}

std::vector<std::string> connectedUris() {
  openni::Array<openni::DeviceInfo> devices;
  openni::OpenNI::enumerateDevices(&devices);
  std::vector<std::string> uris;
  for (int i = 0; i < devices.getSize(); ++i) uris.emplace_back(devices[i].getUri());
  return uris;
}

bool isFile(const std::string& device) {
  return std::filesystem::path(device).extension() == ".oni";
}

/// The URI of the device that somebody means.
std::string findUri(const std::string& device) {
  if (isFile(device)) {
    if (!std::filesystem::exists(device)) throw std::runtime_error(device + ": no such file");
    return device;
  }
  const auto uris = connectedUris();
  if (uris.empty()) throw std::runtime_error("no OpenNI2 camera is connected");
  if (device.empty()) return uris.front();
  for (std::size_t i = 0; i < uris.size(); ++i)
    if (device == uris[i] || device == "#" + std::to_string(i + 1)) return uris[i];
  std::string there;
  for (const auto& uri : uris) {
    const auto serial = serialOf(uri);
    if (!serial.empty() && serial == device) return uri;
    there += (there.empty() ? "" : ", ") + uri + (serial.empty() ? "" : " (serial " + serial + ")");
  }
  throw std::runtime_error("no camera '" + device + "' is connected, there is " + there);
}

std::string modeText(int width, int height, int fps) {
  return std::to_string(width) + " x " + std::to_string(height) + " at " + std::to_string(fps) +
         " Hz";
}

void setMode(openni::VideoStream& stream, bool depth, const OpenniOptions& options) {
  const auto& modes = stream.getSensorInfo().getSupportedVideoModes();
  const auto format = depth ? openni::PIXEL_FORMAT_DEPTH_1_MM : openni::PIXEL_FORMAT_RGB888;
  std::string there;
  for (int i = 0; i < modes.getSize(); ++i) {
    const auto& mode = modes[i];
    if (mode.getPixelFormat() != format) continue;
    if (mode.getResolutionX() == options.width && mode.getResolutionY() == options.height &&
        mode.getFps() == options.fps) {
      check(stream.setVideoMode(mode), "the mode cannot be set");
      return;
    }
    there += (there.empty() ? "" : ", ") +
             modeText(mode.getResolutionX(), mode.getResolutionY(), mode.getFps());
  }
  throw std::invalid_argument(std::string(depth ? "depth" : "colour") + " has no mode " +
                              modeText(options.width, options.height, options.fps) + ", there is " +
                              there);
}

Projection cameraOf(const openni::VideoStream& view, int width, int height) {
  return {width / (2 * std::tan(view.getHorizontalFieldOfView() / 2.0)),
          height / (2 * std::tan(view.getVerticalFieldOfView() / 2.0)),
          (width - 1) / 2.0,
          (height - 1) / 2.0,
          width,
          height,
          1};
}

const char* encodingOf(PixelFormat format) {
  switch (format) {
    case openni::PIXEL_FORMAT_DEPTH_1_MM:
      return "16UC1";
    case openni::PIXEL_FORMAT_RGB888:
      return "rgb8";
    case openni::PIXEL_FORMAT_GRAY8:
      return "mono8";
    default:
      throw std::runtime_error("images of pixel format " + std::to_string(format) +
                               " are not understood");
  }
}

}  // namespace

OpenniLibrary::OpenniLibrary() {
  if (openni::OpenNI::initialize() == openni::STATUS_OK) return;
  const auto reason = lastError();
  openni::OpenNI::shutdown();
  throw std::runtime_error("OpenNI2 cannot be used: " + reason);
}

OpenniLibrary::~OpenniLibrary() { openni::OpenNI::shutdown(); }

OpenniCamera::OpenniCamera(const std::string& device, const OpenniOptions& options)
    : uri_(findUri(device)), registered_(options.registration) {
  check(device_.open(uri_.c_str()), "camera " + uri_ + " cannot be opened");
  const auto serial = serialOf(device_);
  name_ = uri_ + (serial.empty() ? "" : " (serial " + serial + ")");
  if (!device_.hasSensor(openni::SENSOR_DEPTH))
    throw std::runtime_error("camera " + name_ + " has no depth");
  check(depth_.create(device_, openni::SENSOR_DEPTH), "depth of " + name_);
  if (device_.hasSensor(openni::SENSOR_COLOR))
    check(color_.create(device_, openni::SENSOR_COLOR), "colour of " + name_);
  if (!device_.isFile()) setModes(options);
  openni::OpenNI::addDeviceDisconnectedListener(this);
}

OpenniCamera::~OpenniCamera() {
  openni::OpenNI::removeDeviceDisconnectedListener(this);
  stream(false, false);
  depth_.destroy();
  color_.destroy();
  device_.close();
}

void OpenniCamera::setModes(const OpenniOptions& options) {
  setMode(depth_, true, options);
  if (hasColor()) setMode(color_, false, options);

  const auto registration = options.registration ? openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR
                                                 : openni::IMAGE_REGISTRATION_OFF;
  if (device_.isImageRegistrationModeSupported(registration))
    check(device_.setImageRegistrationMode(registration), "registration");
  else if (options.registration)
    throw std::invalid_argument("camera " + name_ +
                                " cannot register depth to colour, registration must be false");
  if (hasColor()) device_.setDepthColorSyncEnabled(true);  // not all can; frames are paired anyway

  for (auto* stream : {&depth_, &color_}) {
    if (!stream->isValid()) continue;
    const auto status = stream->setMirroringEnabled(options.mirror);
    if (status != openni::STATUS_OK && stream->getMirroringEnabled() != options.mirror)
      throw std::invalid_argument("camera " + name_ + " cannot change mirror to " +
                                  (options.mirror ? "true" : "false"));
  }
}

std::string OpenniCamera::setExposure(const OpenniOptions& options) {
  if (device_.isFile() || !hasColor()) return "";
  auto* settings = color_.getCameraSettings();
  if (!settings) return "";
  const auto refused = [&](openni::Status status, bool is_default, const char* name) {
    return status == openni::STATUS_OK || is_default ? "" : std::string(name) + " ";
  };
  std::string text = refused(settings->setAutoExposureEnabled(options.auto_exposure),
                             options.auto_exposure, "auto_exposure");
  if (!options.auto_exposure && options.exposure > 0)
    text += refused(settings->setExposure(options.exposure), false, "exposure");
  text += refused(settings->setAutoWhiteBalanceEnabled(options.auto_white_balance),
                  options.auto_white_balance, "auto_white_balance");
  return text;
}

void OpenniCamera::stream(bool depth, bool color) {
  const auto set = [](openni::VideoStream& stream, bool wanted, bool& runs) {
    if (!stream.isValid() || wanted == runs) return;
    if (wanted)
      check(stream.start(), "a stream cannot be started");
    else
      stream.stop();
    runs = wanted;
  };
  set(depth_, depth, depth_runs_);
  set(color_, color, color_runs_);
}

void OpenniCamera::checkConnected() const {
  if (gone_) throw std::runtime_error("camera " + name_ + " is gone, it is waited for");
}

std::optional<OpenniFrame> OpenniCamera::read(std::chrono::milliseconds timeout) {
  checkConnected();
  std::vector<openni::VideoStream*> running;
  if (depth_runs_) running.push_back(&depth_);
  if (color_runs_) running.push_back(&color_);
  int which = -1;
  const auto status = openni::OpenNI::waitForAnyStream(
      running.data(), static_cast<int>(running.size()), &which, static_cast<int>(timeout.count()));
  checkConnected();
  if (status == openni::STATUS_TIME_OUT) return std::nullopt;
  check(status, "camera " + name_);

  auto& stream = *running[which];
  OpenniFrame result;
  check(stream.readFrame(&result.frame), "camera " + name_);
  const auto& frame = result.frame;
  result.depth = &stream == &depth_;
  result.image = {encodingOf(frame.getVideoMode().getPixelFormat()),
                  static_cast<std::uint32_t>(frame.getWidth()),
                  static_cast<std::uint32_t>(frame.getHeight()),
                  static_cast<std::uint32_t>(frame.getStrideInBytes()),
                  false,
                  static_cast<const std::uint8_t*>(frame.getData()),
                  static_cast<std::size_t>(frame.getDataSize())};
  const bool by_color = registered_ && hasColor();  // registered depth is the colour camera's view
  result.camera = cameraOf(result.depth && !by_color ? depth_
                           : hasColor()              ? color_
                                                     : depth_,
                           frame.getWidth(), frame.getHeight());
  result.time_us = frame.getTimestamp();
  return result;
}

void OpenniCamera::onDeviceDisconnected(const openni::DeviceInfo* info) {
  if (info->getUri() == uri_) gone_ = true;
}

}  // namespace tabletop_perception
