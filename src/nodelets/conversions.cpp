#include "conversions.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>

#include <boost/make_shared.hpp>

namespace tabletop_perception {
namespace {

/// Adds a field of four bytes at the end of the point.
void addField(sensor_msgs::PointCloud2& message, const std::string& name, std::uint8_t datatype) {
  sensor_msgs::PointField field;
  field.name = name;
  field.offset = message.point_step;
  field.datatype = datatype;
  field.count = 1;
  message.fields.push_back(field);
  message.point_step += 4;
}

/// Columns of 4-byte values, one of each per point, side by side.
template <std::size_t COUNT>
void packColumns(const std::array<const void*, COUNT>& columns, std::size_t points,
                 std::uint8_t* to) {
  constexpr std::size_t WIDTH = 4;
  for (std::size_t i = 0; i < points; ++i)
    for (std::size_t k = 0; k < COUNT; ++k, to += WIDTH)
      std::memcpy(to, static_cast<const std::uint8_t*>(columns[k]) + WIDTH * i, WIDTH);
}

TableMessage filledMessage(const Table& table, const std::string& reason,
                           const std_msgs::Header& header) {
  TableMessage message;
  message.header = header;
  message.found = true;
  message.reason = reason;
  std::copy_n(table.plane.data(), 4, message.plane.begin());
  message.pose = messageFromPose(table.T_camera_table);
  for (const auto& corner : hullInCamera(table)) message.hull.push_back(messageFromPoint(corner));
  message.inliers = table.inliers.size();
  message.rms = table.rms;
  return message;
}

}  // namespace

PackedCloud packedView(const sensor_msgs::PointCloud2& message) {
  PackedCloud packed;
  packed.width = message.width;
  packed.height = message.height;
  packed.point_step = message.point_step;
  packed.row_step = message.row_step;
  packed.big_endian = message.is_bigendian;
  for (const auto& field : message.fields)
    packed.fields.push_back({field.name, field.offset, field.datatype, field.count});
  packed.data = message.data.data();
  packed.data_size = message.data.size();
  return packed;
}

Cloud cloudFromMessage(const sensor_msgs::PointCloud2& message) {
  return unpackCloud(packedView(message));
}

std::vector<std::uint32_t> labelsFromMessage(const sensor_msgs::PointCloud2& message) {
  return unpackLabels(packedView(message));
}

sensor_msgs::PointCloud2 layoutOf(const Cloud& cloud, const std_msgs::Header& header,
                                  bool labelled) {
  using sensor_msgs::PointField;
  sensor_msgs::PointCloud2 message;
  message.header = header;
  message.width = cloud.width;
  message.height = cloud.height;
  message.is_dense = false;
  for (const char* axis : {"x", "y", "z"}) addField(message, axis, PointField::FLOAT32);
  // The bits of a colour are declared as a float: what PCL and rviz expect.
  if (cloud.colored()) addField(message, "rgb", PointField::FLOAT32);
  if (labelled) addField(message, "label", PointField::UINT32);
  message.row_step = message.point_step * message.width;
  return message;
}

void packPoints(const Cloud& cloud, const std::vector<std::uint32_t>* labels, std::uint8_t* to) {
  const void *x = cloud.x.data(), *y = cloud.y.data(), *z = cloud.z.data();
  const void *rgb = cloud.rgb.data(), *label = labels ? labels->data() : nullptr;
  if (cloud.colored() && labels)
    packColumns<5>({x, y, z, rgb, label}, cloud.size(), to);
  else if (cloud.colored() || labels)
    packColumns<4>({x, y, z, labels ? label : rgb}, cloud.size(), to);
  else
    packColumns<3>({x, y, z}, cloud.size(), to);
}

sensor_msgs::PointCloud2Ptr messageFromCloud(const Cloud& cloud, const std_msgs::Header& header,
                                             const std::vector<std::uint32_t>* labels) {
  auto message =
      boost::make_shared<sensor_msgs::PointCloud2>(layoutOf(cloud, header, labels != nullptr));
  message->data.resize(std::size_t{message->row_step} * message->height);
  packPoints(cloud, labels, message->data.data());
  return message;
}

geometry_msgs::Point messageFromPoint(const Eigen::Vector3d& point) {
  geometry_msgs::Point message;
  message.x = point.x();
  message.y = point.y();
  message.z = point.z();
  return message;
}

Eigen::Vector3d pointFromMessage(const geometry_msgs::Point& message) {
  return {message.x, message.y, message.z};
}

geometry_msgs::Pose messageFromPose(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond rotation(pose.linear());
  geometry_msgs::Pose message;
  message.position = messageFromPoint(pose.translation());
  message.orientation.x = rotation.x();
  message.orientation.y = rotation.y();
  message.orientation.z = rotation.z();
  message.orientation.w = rotation.w();
  return message;
}

Eigen::Isometry3d poseFromMessage(const geometry_msgs::Pose& message) {
  const auto& q = message.orientation;
  return Eigen::Translation3d(pointFromMessage(message.position)) *
         Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized();
}

geometry_msgs::TransformStamped transformMessage(const geometry_msgs::Pose& pose,
                                                 const std_msgs::Header& header,
                                                 const std::string& child_frame_id) {
  geometry_msgs::TransformStamped message;
  message.header = header;
  message.child_frame_id = child_frame_id;
  message.transform.translation.x = pose.position.x;
  message.transform.translation.y = pose.position.y;
  message.transform.translation.z = pose.position.z;
  message.transform.rotation = pose.orientation;
  return message;
}

TableMessagePtr messageFromTable(const Found<std::vector<Table>>& tables,
                                 const std_msgs::Header& header) {
  if (tables)
    return boost::make_shared<TableMessage>(filledMessage(tables->front(), tables.reason, header));
  auto message = boost::make_shared<TableMessage>();
  message->header = header;
  message->reason = tables.reason;
  message->pose.orientation.w = 1;
  return message;
}

TableArrayPtr messageFromTables(const Found<std::vector<Table>>& tables,
                                const std_msgs::Header& header) {
  auto message = boost::make_shared<TableArray>();
  message->header = header;
  message->reason = tables.reason;
  if (tables)
    for (const auto& table : *tables)
      message->tables.push_back(filledMessage(table, tables.reason, header));
  return message;
}

std::vector<Table> tablesFromMessage(const TableArray& message) {
  std::vector<Table> tables;
  for (const auto& entry : message.tables) {
    Table table;
    std::copy_n(entry.plane.begin(), 4, table.plane.data());
    table.T_camera_table = poseFromMessage(entry.pose);
    const Eigen::Isometry3d T_table_camera = table.T_camera_table.inverse();
    for (const auto& corner : entry.hull)
      table.hull.push_back((T_table_camera * pointFromMessage(corner)).head<2>());
    table.rms = entry.rms;
    tables.push_back(std::move(table));
  }
  return tables;
}

ClusterCandidates messageFromProposal(const Proposal& proposal) {
  ClusterCandidates message;
  message.labels = proposal.labels;
  message.reason = proposal.candidates.reason;
  if (!proposal.candidates) return message;
  for (const auto& candidate : *proposal.candidates) {
    MatchCandidate entry;
    entry.name = candidate.name;
    entry.distance = candidate.distance;
    entry.promise = candidate.promise;
    entry.pose = messageFromPose(candidate.T_camera_object);
    message.candidates.push_back(entry);
  }
  return message;
}

Proposal proposalFromMessage(const ClusterCandidates& message, std::size_t clusters) {
  for (const auto label : message.labels)
    if (label < 2 || label - 2 >= clusters)
      throw std::invalid_argument("candidates of label " + std::to_string(label) +
                                  ": the cloud has labels 2 to " + std::to_string(clusters + 1));
  if (message.candidates.empty())
    return {message.labels, Found<std::vector<Candidate>>::none(message.reason)};
  std::vector<Candidate> candidates;
  for (const auto& entry : message.candidates) {
    Candidate candidate;
    candidate.name = entry.name;
    candidate.distance = entry.distance;
    candidate.promise = entry.promise;
    candidate.T_camera_object = poseFromMessage(entry.pose);
    candidates.push_back(candidate);
  }
  return {message.labels, candidates};
}

RecognizedObject messageFromObject(const SceneObject& object, std::uint32_t id,
                                   const std_msgs::Header& header) {
  RecognizedObject message;
  message.header = header;
  message.id = id;
  message.name = object.name;
  message.child_frame_id = objectFrame(object.name, id);
  message.score = object.score;
  message.pose = messageFromPose(object.T_camera_object);
  message.fitness = object.fitness;
  message.visible = object.visible;
  message.labels = object.labels;
  message.points = object.points;
  message.box_pose = messageFromPose(object.box.T_camera_box);
  message.box_size.x = object.box.size.x();
  message.box_size.y = object.box.size.y();
  message.box_size.z = object.box.size.z();
  message.reason = object.reason;
  return message;
}

namespace {

Grasp messageFromGrasp(const PlacedGrasp& placed) {
  Grasp message;
  message.name = placed.grasp.name;
  message.pose = messageFromPose(placed.T_camera_gripper);
  message.pregrasp = messageFromPose(placed.T_camera_pregrasp);
  message.width = placed.grasp.width;
  message.preference = placed.grasp.preference;
  message.reason = placed.reason;
  return message;
}

}  // namespace

void addGrasps(const std::vector<PlacedGrasp>& grasps, RecognizedObject& message) {
  for (const auto& placed : grasps) message.grasps.push_back(messageFromGrasp(placed));
}

geometry_msgs::PoseArray usableGrasps(const RecognizedObject& object) {
  geometry_msgs::PoseArray poses;
  poses.header = object.header;
  for (const auto& grasp : object.grasps)
    if (grasp.reason.empty()) poses.poses.push_back(grasp.pose);
  return poses;
}

RecognizedObject movedTo(const std::string& target_frame, const Eigen::Isometry3d& T_target_camera,
                         RecognizedObject object) {
  const auto move = [&](geometry_msgs::Pose& pose) {
    pose = messageFromPose(T_target_camera * poseFromMessage(pose));
  };
  object.header.frame_id = target_frame;
  move(object.pose);
  move(object.box_pose);
  for (auto& grasp : object.grasps) {
    move(grasp.pose);
    move(grasp.pregrasp);
  }
  return object;
}

std::string objectFrame(const std::string& name, std::uint32_t id) {
  std::string frame = name + '_' + std::to_string(id);
  const auto allowed = [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-'; };
  std::replace_if(
      frame.begin(), frame.end(), [&](char c) { return !allowed(c); }, '_');
  return frame;
}

}  // namespace tabletop_perception
