#include "scene_source.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>
#include <string_view>
#include <vector>

#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "bag_file.h"
#include "conversions.h"
#include "tabletop_perception/depth_image.h"
#include "tabletop_perception/pcd.h"

namespace tabletop_perception::tools {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

using Visit = std::function<void(const Scene&)>;

constexpr char CLOUD_TYPE[] = "sensor_msgs/PointCloud2";

/// How a depth image becomes points.
struct DepthCamera {
  double fx, fy, cx, cy;  // [pixels]
  int width, height;      // [pixels]
  double depth_unit;      // of the image's numbers [m]
};

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  throw std::invalid_argument(file.string() + ": " + what);
}

/// The last part of a path; of a folder also where the path ends in a slash or is ".".
std::string lastName(const fs::path& path) {
  const auto whole = fs::absolute(path).lexically_normal();
  return whole.has_filename() ? whole.filename() : whole.parent_path().filename();
}

void checkKind(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) refuse(path, "no such file or folder");
  if (fs::is_directory(path)) return;
  const auto extension = path.extension();
  if (extension != ".pcd" && extension != ".bag")
    refuse(path, "not a scene: a .pcd, a .bag or a folder with depth.png is needed");
}

void visitPcd(const fs::path& file, const Visit& visit) {
  auto contents = readPcd(file);
  Scene scene;
  scene.name = file.stem();
  scene.sensor = contents.T_data_sensor.translation();
  scene.cloud = std::move(contents.cloud);
  if (!scene.sensor.isZero()) {
    const Eigen::Vector3f sensor = scene.sensor.cast<float>();
    for (const int i : validIndices(scene.cloud))
      scene.cloud.setPoint(i, scene.cloud.point(i) - sensor);
  }
  visit(scene);
}

std::string joined(const std::set<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

/// The topic to read: `wanted`, or the bag's only one with clouds.
std::string cloudTopic(rosbag::Bag& bag, const fs::path& file, const std::string& wanted) {
  std::set<std::string> topics;
  rosbag::View view(bag);
  for (const auto* connection : view.getConnections())
    if (connection->datatype == CLOUD_TYPE) topics.insert(connection->topic);

  if (topics.empty()) refuse(file, std::string("no topic of type ") + CLOUD_TYPE + " in the bag");
  if (wanted.empty() && topics.size() > 1)
    refuse(file, "several topics with clouds, choose one with --topic: " + joined(topics));
  if (wanted.empty()) return *topics.begin();
  if (topics.count(wanted) == 0)
    refuse(file, "no topic " + wanted + " with clouds in the bag; there is " + joined(topics));
  return wanted;
}

Scene sceneFromMessage(const rosbag::MessageInstance& instance, const std::string& name) {
  const auto message = instance.instantiate<sensor_msgs::PointCloud2>();
  if (!message) throw std::invalid_argument("another version of sensor_msgs/PointCloud2");
  Scene scene;
  scene.name = name;
  scene.frame_id = message->header.frame_id;
  scene.stamp = message->header.stamp.toSec();
  scene.cloud = cloudFromMessage(*message);
  return scene;
}

void visitClouds(rosbag::Bag& bag, const fs::path& file, const std::string& topic,
                 const Visit& visit) {
  rosbag::View view(bag, [&](const rosbag::ConnectionInfo* connection) {
    return connection->topic == topic && connection->datatype == CLOUD_TYPE;
  });
  if (view.size() == 0) refuse(file, "no message on topic " + topic);
  int number = 0;
  for (const auto& instance : view) {
    char suffix[16];
    std::snprintf(suffix, sizeof suffix, "_%06d", number++);
    const auto name = file.stem().string() + suffix;
    Scene scene;
    try {
      scene = sceneFromMessage(instance, name);
    } catch (const std::invalid_argument& error) {
      refuse(file, "cloud " + name + ": " + error.what());
    }
    visit(scene);
  }
}

void visitBag(const fs::path& file, const std::string& wanted_topic, const Visit& visit) {
  readBag(file, [&](rosbag::Bag& bag) {
    visitClouds(bag, file, cloudTopic(bag, file, wanted_topic), visit);
  });
}

json readJson(const fs::path& file) {
  std::ifstream stream(file);
  if (!stream) refuse(file, "cannot be opened");
  try {
    return json::parse(stream);
  } catch (const json::exception& error) {
    refuse(file, std::string("not valid JSON: ") + error.what());
  }
}

double numberIn(const json& object, const char* key, const fs::path& file) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number())
    refuse(file, std::string("needs a number `") + key + "`");
  return found->get<double>();
}

double positiveIn(const json& object, const char* key, const fs::path& file) {
  const double value = numberIn(object, key, file);
  if (!(value > 0))
    refuse(file, std::string("`") + key + "` must be positive, got " + object[key].dump());
  return value;
}

DepthCamera cameraIn(const json& data, const fs::path& file) {
  if (!data.is_object() || !data.contains("camera") || !data["camera"].is_object())
    refuse(file, "no `camera` {fx, fy, cx, cy, width, height} in it");
  const auto& camera = data["camera"];
  return {positiveIn(camera, "fx", file),
          positiveIn(camera, "fy", file),
          numberIn(camera, "cx", file),
          numberIn(camera, "cy", file),
          static_cast<int>(positiveIn(camera, "width", file)),
          static_cast<int>(positiveIn(camera, "height", file)),
          positiveIn(data, "depth_unit_m", file)};
}

std::optional<Eigen::Vector3d> upIn(const json& data, const fs::path& file) {
  if (!data.contains("up") || data["up"].is_null()) return std::nullopt;
  const auto& up = data["up"];
  const auto is_number = [](const json& value) { return value.is_number(); };
  if (!up.is_array() || up.size() != 3 || !std::all_of(up.begin(), up.end(), is_number))
    refuse(file, "`up` must be three numbers, got " + up.dump());
  const Eigen::Vector3d direction(up[0], up[1], up[2]);
  if (direction.isZero()) refuse(file, "`up` must not be zero");
  return direction.normalized();
}

fs::path cameraFile(const fs::path& folder) {
  for (const auto* name : {"gt.json", "camera.json"})
    if (fs::exists(folder / name)) return folder / name;
  refuse(folder, "neither gt.json nor camera.json in the folder");
}

/// The bytes of a PNG file. One that is cut short lacks its closing chunk; checked here, because
/// the decoder prints its own complaint.
std::vector<char> readPng(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::vector<char> bytes(std::istreambuf_iterator<char>(stream), {});
  const std::string_view text(bytes.data(), bytes.size());
  if (text.substr(0, 4) != "\x89PNG") refuse(file, "not a PNG image");
  if (text.find("IEND") == text.npos) refuse(file, "the image is cut short");
  return bytes;
}

/// An image of the size that the camera states and of the given OpenCV type.
cv::Mat readImage(const fs::path& file, int flags, int type, const char* type_name,
                  const DepthCamera& camera) {
  const cv::Mat image = cv::imdecode(readPng(file), flags);
  if (image.empty()) refuse(file, "not a readable image");
  if (image.type() != type) refuse(file, std::string("must be ") + type_name);
  if (image.cols != camera.width || image.rows != camera.height)
    refuse(file, "is " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
                     " pixels, the camera " + std::to_string(camera.width) + " x " +
                     std::to_string(camera.height));
  return image;
}

PackedImage packedView(const cv::Mat& image, const char* encoding) {
  return {encoding,
          static_cast<std::uint32_t>(image.cols),
          static_cast<std::uint32_t>(image.rows),
          static_cast<std::uint32_t>(image.step),
          false,
          image.data,
          image.step * image.rows};
}

void visitFolder(const fs::path& folder, const Visit& visit) {
  if (!fs::exists(folder / "depth.png")) refuse(folder, "no depth.png in the folder");
  const auto camera_file = cameraFile(folder);
  const auto data = readJson(camera_file);
  const auto camera = cameraIn(data, camera_file);
  const cv::Mat depth = readImage(folder / "depth.png", cv::IMREAD_UNCHANGED, CV_16UC1,
                                  "16 bit, one channel", camera);
  cv::Mat color;
  if (fs::exists(folder / "color.png"))
    color = readImage(folder / "color.png", cv::IMREAD_COLOR, CV_8UC3, "8 bit colour", camera);

  Scene scene;
  scene.name = lastName(folder);
  const auto packed_color = packedView(color, "bgr8");
  DepthImageOptions everything;
  everything.max_range = 100;
  try {
    scene.cloud =
        cloudFromDepth(packedView(depth, "16UC1"), color.empty() ? nullptr : &packed_color,
                       {camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height, 1},
                       everything, nullptr, camera.depth_unit);
  } catch (const std::invalid_argument& error) {
    refuse(folder, error.what());
  }
  scene.up = upIn(data, camera_file);
  visit(scene);
}

}  // namespace

void visitScenes(const std::vector<std::string>& arguments, const std::string& topic,
                 const std::function<void(const Scene&)>& visit) {
  for (const auto& argument : arguments) checkKind(argument);
  for (const fs::path path : arguments) {
    if (fs::is_directory(path))
      visitFolder(path, visit);
    else if (path.extension() == ".bag")
      visitBag(path, topic, visit);
    else
      visitPcd(path, visit);
  }
}

}  // namespace tabletop_perception::tools
