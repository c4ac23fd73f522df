#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "stage_nodelet.h"
#include "tabletop_perception/TableConfig.h"
#include "tabletop_perception/table.h"
#include "tf_wait.h"

namespace tabletop_perception {

/// `~input` PointCloud2 -> `~objects` PointCloud2 of what stands on the tables, `~tables`
/// TableArray of all of them, `~table` Table, the main one, and its tf frame. Every frame is
/// answered, also one without a table.
///
/// Parameters: `up`, the direction against gravity in the cloud's frame [x, y, z], or `pitch`, how
/// far a level camera looks below the horizon [deg], or `up_frame`, the tf frame whose z axis is
/// up, with `up_timeout` [s]; `table_frame` and `publish_tf`.
class TableNodelet : public StageNodelet {
  void start() override {
    up_ = statedUp();
    up_frame_ = parameter("up_frame", std::string());
    if (up_ && !up_frame_.empty())
      throw std::invalid_argument("up is given twice: by up_frame and by up or pitch; keep one");
    up_timeout_ = parameter("up_timeout", 0.2);
    table_frame_ = parameter("table_frame", std::string("table"));
    publish_tf_ = parameter("publish_tf", true);
    serveOptions<TableConfig>(getPrivateNodeHandle(), options_);

    if (!up_frame_.empty()) tf_listener_ = std::make_unique<tf2_ros::TransformListener>(tf_);
    objects_pub_ = advertise<CloudMessage>("objects");
    table_pub_ = advertise<TableMessage>("table");
    tables_pub_ = advertise<TableArray>("tables");
  }

  void subscribe() override {
    input_sub_ =
        getPrivateNodeHandle().subscribe("input", INNER_QUEUE, &TableNodelet::onCloud, this);
  }

  void unsubscribe() override { input_sub_.shutdown(); }

  bool wantedAnyway() override { return publish_tf_; }

  void onCloud(const CloudMessageConstPtr& message) {
    attempt([&] {
      const Cloud& cloud = message->cloud();
      const auto tables = tablesIn(cloud, message->header);
      const auto table_message = messageFromTable(tables, message->header);
      table_pub_.publish(table_message);
      tables_pub_.publish(messageFromTables(tables, message->header));
      if (tables && publish_tf_)
        tf_broadcaster_.sendTransform(
            transformMessage(table_message->pose, message->header, table_frame_));

      if (objects_pub_.getNumSubscribers() == 0) return;
      objects_pub_.publish(boost::make_shared<CloudMessage>(
          *message, indicesOnTables(cloud, tables.value.value_or(std::vector<Table>()), options_)));
    });
  }

  /// Up in the cloud's frame as `up` or `pitch` say; none if neither does.
  std::optional<Eigen::Vector3d> statedUp() {
    const auto up = parameter("up", std::vector<double>{0, 0, 0});
    if (up.size() != 3) throw std::invalid_argument("up must be [x, y, z]");
    const Eigen::Vector3d direction(up[0], up[1], up[2]);
    const double pitch = parameter("pitch", std::numeric_limits<double>::quiet_NaN());
    if (std::isnan(pitch))  // not set
      return direction.isZero() ? std::nullopt : std::optional(direction.normalized());
    checkOption("pitch", pitch, Range{-90, 90});
    if (!direction.isZero())
      throw std::invalid_argument("up is given twice: by up and by pitch; keep one");
    return upOfPitch(pitch);
  }

  /// The tables, or why there is none: also when up is not known although it should be.
  Found<std::vector<Table>> tablesIn(const Cloud& cloud, const std_msgs::Header& header) {
    std::optional<Eigen::Vector3d> up;
    try {
      up = upIn(header);
    } catch (const tf2::TransformException& error) {
      warn(std::string("no up direction: ") + error.what());
      return Found<std::vector<Table>>::none(std::string("no up direction: ") + error.what());
    }
    return findTables(cloud, up, options_);
  }

  /// The direction against gravity in the cloud's frame, if it is to be used.
  std::optional<Eigen::Vector3d> upIn(const std_msgs::Header& header) {
    if (up_frame_.empty()) return up_;
    const auto deadline = std::chrono::steady_clock::now() +
                          std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                              std::chrono::duration<double>(up_timeout_));
    return lookupTransformBy(deadline, tf_, header.frame_id, up_frame_, header.stamp)
        .linear()
        .col(2);
  }

  TableOptions options_;
  std::optional<Eigen::Vector3d> up_;
  std::string up_frame_;
  double up_timeout_;
  std::string table_frame_;
  bool publish_tf_;

  tf2_ros::Buffer tf_;
  std::unique_ptr<tf2_ros::TransformListener> tf_listener_;
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  ros::Publisher objects_pub_, table_pub_, tables_pub_;
  ros::Subscriber input_sub_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::TableNodelet, nodelet::Nodelet)
