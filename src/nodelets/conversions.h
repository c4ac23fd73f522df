#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <geometry_msgs/Point.h>
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/TransformStamped.h>
#include <sensor_msgs/PointCloud2.h>

#include <Eigen/Geometry>

#include "messages.h"
#include "tabletop_perception/cloud.h"
#include "tabletop_perception/found.h"
#include "tabletop_perception/grasp.h"
#include "tabletop_perception/match.h"
#include "tabletop_perception/packed_cloud.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

/// The message's bytes as the core reads them; only as long as the message is there.
PackedCloud packedView(const sensor_msgs::PointCloud2& message);

/// The points of a message. Throws std::invalid_argument when its fields and sizes do not add up
/// (see unpackCloud).
Cloud cloudFromMessage(const sensor_msgs::PointCloud2& message);

/// The `label` field of a message, one per point; throws std::invalid_argument without one.
std::vector<std::uint32_t> labelsFromMessage(const sensor_msgs::PointCloud2& message);

/// The message of a cloud without its data: fields x, y, z, rgb (where it has colour) and label
/// (where there are labels), width and height as in the cloud.
sensor_msgs::PointCloud2 layoutOf(const Cloud& cloud, const std_msgs::Header& header,
                                  bool labelled);

/// The data of that message, row_step x height bytes. `labels`: one per point; null: none.
void packPoints(const Cloud& cloud, const std::vector<std::uint32_t>* labels, std::uint8_t* to);

/// The whole message. `labels`: one per point; null: none.
sensor_msgs::PointCloud2Ptr messageFromCloud(const Cloud& cloud, const std_msgs::Header& header,
                                             const std::vector<std::uint32_t>* labels = nullptr);

geometry_msgs::Point messageFromPoint(const Eigen::Vector3d& point);
Eigen::Vector3d pointFromMessage(const geometry_msgs::Point& message);
geometry_msgs::Pose messageFromPose(const Eigen::Isometry3d& pose);
Eigen::Isometry3d poseFromMessage(const geometry_msgs::Pose& message);

/// The pose of `child_frame_id` in the header's frame, for tf.
geometry_msgs::TransformStamped transformMessage(const geometry_msgs::Pose& pose,
                                                 const std_msgs::Header& header,
                                                 const std::string& child_frame_id);

/// The main table, or why there is none.
TableMessagePtr messageFromTable(const Found<std::vector<Table>>& tables,
                                 const std_msgs::Header& header);

/// All tables, the main one first, or why there is none.
TableArrayPtr messageFromTables(const Found<std::vector<Table>>& tables,
                                const std_msgs::Header& header);

/// The tables in a message; their inliers' indices do not travel and are empty.
std::vector<Table> tablesFromMessage(const TableArray& message);

/// What some clusters may be, or why nothing. Back from a message throws std::invalid_argument for
/// labels that none of so many clusters has.
ClusterCandidates messageFromProposal(const Proposal& proposal);
Proposal proposalFromMessage(const ClusterCandidates& message, std::size_t clusters);

/// A thing on the table, with the id that the tracker gave it.
RecognizedObject messageFromObject(const SceneObject& object, std::uint32_t id,
                                   const std_msgs::Header& header);

/// Adds the grasps of the object, in the frame of the message's poses.
void addGrasps(const std::vector<PlacedGrasp>& grasps, RecognizedObject& message);

/// Where the gripper closes by the grasps that can be used, the preferred ones first.
geometry_msgs::PoseArray usableGrasps(const RecognizedObject& object);

/// The object with all its poses in another frame.
RecognizedObject movedTo(const std::string& target_frame, const Eigen::Isometry3d& T_target_camera,
                         RecognizedObject object);

/// `name` and `id` as a tf frame: <name>_<id>, with every character that is no letter, digit, '_'
/// or '-' replaced by '_'.
std::string objectFrame(const std::string& name, std::uint32_t id);

}  // namespace tabletop_perception
