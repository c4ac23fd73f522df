#include "marker_messages.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <string>

#include <boost/make_shared.hpp>

#include "conversions.h"
#include "tabletop_perception/geometry.h"

namespace tabletop_perception {
namespace {

using visualization_msgs::Marker;

/// Colours that are told apart easily, 0x00RRGGBB.
constexpr std::array<std::uint32_t, 8> PALETTE = {0xe6194b, 0x3cb44b, 0x4363d8, 0xf58231,
                                                  0x911eb4, 0x46f0f0, 0xf032e6, 0xbcf60c};
constexpr std::uint32_t TABLE_COLOR = 0xffe119;
constexpr std::uint32_t MODEL_COLOR = 0x00ff60;  ///< of models that were trained without colour
constexpr std::uint32_t TEXT_COLOR = 0xffffff;

std::uint32_t colorOf(std::uint32_t id) { return PALETTE[id % PALETTE.size()]; }

std_msgs::ColorRGBA colorMessage(std::uint32_t rgb) {
  std_msgs::ColorRGBA color;
  color.r = ((rgb >> 16) & 255) / 255.f;
  color.g = ((rgb >> 8) & 255) / 255.f;
  color.b = (rgb & 255) / 255.f;
  color.a = 1;
  return color;
}

Marker marker(const std_msgs::Header& header, const std::string& ns, int id, int type,
              std::uint32_t color) {
  Marker message;
  message.header = header;
  message.ns = ns;
  message.id = id;
  message.type = type;
  message.pose.orientation.w = 1;
  message.color = colorMessage(color);
  return message;
}

Marker hullMarker(const TableMessage& table, int id, const MarkerOptions& options) {
  Marker message = marker(table.header, "table", id, Marker::LINE_STRIP, TABLE_COLOR);
  message.scale.x = options.line_width;
  message.points = table.hull;
  message.points.push_back(table.hull.front());
  return message;
}

/// The twelve edges of the object's box.
Marker boxMarker(const RecognizedObject& object, const std::string& ns,
                 const MarkerOptions& options) {
  Marker message = marker(object.header, ns, object.id, Marker::LINE_LIST, colorOf(object.id));
  message.scale.x = options.line_width;
  message.pose = object.box_pose;
  const Eigen::Vector3d half(object.box_size.x / 2, object.box_size.y / 2, object.box_size.z / 2);
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 4; ++side) {
      Eigen::Vector3d end = half;
      if (side & 1) end[(axis + 1) % 3] *= -1;
      if (side & 2) end[(axis + 2) % 3] *= -1;
      message.points.push_back(messageFromPoint(end));
      end[axis] *= -1;
      message.points.push_back(messageFromPoint(end));
    }
  return message;
}

/// The object's name above its box.
Marker nameMarker(const RecognizedObject& object, const Eigen::Vector3d& up,
                  const MarkerOptions& options) {
  Marker message = marker(object.header, "name", object.id, Marker::TEXT_VIEW_FACING, TEXT_COLOR);
  message.scale.z = options.text_height;
  message.text = object.name;
  if (object.score > 0) {
    char score[16];
    std::snprintf(score, sizeof score, " %.2f", object.score);
    message.text += score;
  }
  const Eigen::Isometry3d T_camera_box = poseFromMessage(object.box_pose);
  const Eigen::Vector3d half(object.box_size.x / 2, object.box_size.y / 2, object.box_size.z / 2);
  const double top = (T_camera_box.linear().transpose() * up).cwiseAbs().dot(half);
  message.pose.position =
      messageFromPoint(T_camera_box.translation() + (top + options.text_gap) * up);
  return message;
}

}  // namespace

visualization_msgs::MarkerArrayPtr sceneMarkers(const RecognizedObjectArray& objects,
                                                const TableArray& tables,
                                                const MarkerOptions& options) {
  auto message = boost::make_shared<visualization_msgs::MarkerArray>();
  message->markers.push_back(marker(objects.header, "", 0, Marker::CUBE, 0));
  message->markers.back().action = Marker::DELETEALL;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const auto& table : tables.tables) {
    const int id = static_cast<int>(&table - tables.tables.data());
    message->markers.push_back(hullMarker(table, id, options));
    if (id == 0) up = {table.plane[0], table.plane[1], table.plane[2]};
  }

  for (const auto& object : objects.objects) {
    message->markers.push_back(nameMarker(object, up, options));
    const bool known = object.score > 0;
    message->markers.push_back(boxMarker(object, known ? "known_box" : "box", options));
  }
  return message;
}

Cloud coloredThings(const Cloud& cloud, const std::vector<std::uint32_t>& labels,
                    const RecognizedObjectArray& objects) {
  std::map<std::uint32_t, std::uint32_t> color_of_label;
  for (const auto& object : objects.objects)
    for (const auto label : object.labels) color_of_label[label] = colorOf(object.id);

  Indices things;
  std::vector<std::uint32_t> colors;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const auto color = color_of_label.find(labels[i]);
    if (color == color_of_label.end()) continue;
    things.push_back(static_cast<int>(i));
    colors.push_back(color->second);
  }
  Cloud colored = selectPoints(cloud, things);
  colored.rgb = colors;
  return colored;
}

Cloud modelsAtPoses(const RecognizedObjectArray& objects, const ModelIndex& index) {
  Cloud cloud;
  for (const auto& object : objects.objects) {
    const int m = index.find(object.name);
    if (m < 0) continue;
    const ObjectModel& model = index.models()[m];
    const Surface placed = transformed(model.surface, poseFromMessage(object.pose));
    for (std::size_t i = 0; i < placed.size(); ++i) {
      cloud.x.push_back(placed.points[i].x());
      cloud.y.push_back(placed.points[i].y());
      cloud.z.push_back(placed.points[i].z());
      cloud.rgb.push_back(model.colors.empty() ? MODEL_COLOR : model.colors[i]);
    }
  }
  cloud.width = static_cast<int>(cloud.size());
  cloud.height = 1;
  return cloud;
}

visualization_msgs::MarkerArrayPtr pickMarkers(const PickedObject& picked, double depth) {
  constexpr double AXIS_LENGTH = 0.08, AXIS_WIDTH = 0.008, HEAD_WIDTH = 0.02;  // [m]
  constexpr double BEYOND = 0.04;           // the surface's edge [m]
  constexpr double DISC_THICKNESS = 0.001;  // [m]
  auto message = boost::make_shared<visualization_msgs::MarkerArray>();
  message->markers.push_back(marker(picked.header, "", 0, Marker::CUBE, 0));
  message->markers.back().action = Marker::DELETEALL;
  if (!picked.success) return message;
  MarkerOptions options;
  message->markers.push_back(boxMarker(picked.object, "box", options));

  const auto addArrow = [&](const std::string& ns, int id, const geometry_msgs::Pose& pose,
                            const Eigen::Vector3d& from, const Eigen::Vector3d& along,
                            std::uint32_t color) {
    Marker arrow = marker(picked.header, ns, id, Marker::ARROW, color);
    arrow.pose = pose;
    arrow.scale.x = AXIS_WIDTH;
    arrow.scale.y = HEAD_WIDTH;
    arrow.points = {messageFromPoint(from), messageFromPoint(from + along)};
    message->markers.push_back(arrow);
  };
  constexpr std::array<std::uint32_t, 3> AXES = {0xff0000, 0x00ff00, 0x0000ff};
  const Eigen::Vector3d lengths(picked.extents[0] / 2 + BEYOND, picked.extents[1] / 2 + BEYOND,
                                AXIS_LENGTH);
  // From before the surface: the origin lies within the thing, which would hide them.
  const Eigen::Vector3d outside = (depth + AXIS_WIDTH) * Eigen::Vector3d::UnitZ();
  for (int axis = 0; axis < 3; ++axis)
    addArrow("axes", axis, picked.pose, outside, lengths[axis] * Eigen::Vector3d::Unit(axis),
             AXES[axis]);
  addArrow("approach", 0, picked.pregrasp, Eigen::Vector3d::Zero(),
           AXIS_LENGTH * Eigen::Vector3d::UnitZ(), TEXT_COLOR);

  Marker disc = marker(picked.header, "plane", 0, Marker::CYLINDER, TABLE_COLOR);
  const Eigen::Vector3d up(picked.plane[0], picked.plane[1], picked.plane[2]);
  const Eigen::Vector3d middle = poseFromMessage(picked.object.box_pose).translation();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotationBetween(Eigen::Vector3d::UnitZ(), up);
  pose.translation() = middle - (up.dot(middle) + picked.plane[3]) * up;
  disc.pose = messageFromPose(pose);
  disc.scale.x = disc.scale.y = 1.5 * std::max({picked.object.box_size.x, picked.object.box_size.y,
                                                picked.object.box_size.z});
  disc.scale.z = DISC_THICKNESS;
  disc.color.a = 0.4f;
  message->markers.push_back(disc);
  return message;
}

}  // namespace tabletop_perception
