#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

#include <message_filters/subscriber.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>
#include <ros/callback_queue.h>
#include <ros/spinner.h>
#include <tabletop_perception/CaptureView.h>
#include <tf2_ros/transform_listener.h>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "model_source.h"
#include "options_ros.h"
#include "stage_nodelet.h"
#include "tabletop_perception/train.h"
#include "tf_wait.h"

namespace tabletop_perception {
namespace {

using Clock = std::chrono::steady_clock;

/// The only thing on the tables; throws with the reason when there is none, or another.
Cloud loneObject(const CloudMessage& message, const TableArray& tables,
                 const PipelineOptions& options) {
  if (tables.tables.empty()) throw std::invalid_argument("no table: " + tables.reason);
  const Cloud& cloud = message.cloud();
  const auto standing = indicesOnTables(cloud, tablesFromMessage(tables), options.table);
  const auto things = extractClusters(cloud, standing, options.cluster);
  if (things.empty())
    throw std::invalid_argument("nothing stands on the table that has " +
                                std::to_string(options.cluster.min_points) + " points");
  if (things.size() > 1)
    throw std::invalid_argument(std::to_string(things.size()) +
                                " things stand on the table, the object must be alone there");
  return selectPoints(cloud, things.front());
}

}  // namespace

/// `~cloud` PointCloud2 and `~tables` TableArray of one frame; service `~capture_view` adds the
/// only thing on the table to the database, view by view. Clouds are listened to only while a call
/// waits.
///
/// Parameter: `database`, the file with the objects.
class CaptureNodelet : public StageNodelet {
 public:
  ~CaptureNodelet() override {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    arrived_.notify_all();
    if (spinner_) spinner_->stop();
  }

 private:
  struct Frame {
    CloudMessageConstPtr cloud;
    TableArrayConstPtr tables;
  };

  void start() override {
    file_ = expandHome(parameter("database", std::string("~/.ros/tabletop.db")));
    refuseOtherParameters();
    sync_.registerCallback(&CaptureNodelet::onFrame, this);
    ros::NodeHandle service_nh(getPrivateNodeHandle());
    service_nh.setCallbackQueue(&service_queue_);
    service_ = service_nh.advertiseService("capture_view", &CaptureNodelet::onService, this);
    spinner_ = std::make_unique<ros::AsyncSpinner>(1, &service_queue_);  // one view after the other
    spinner_->start();
  }

  void subscribe() override {
    cloud_sub_.subscribe(getPrivateNodeHandle(), "cloud", SYNC_QUEUE);
    tables_sub_.subscribe(getPrivateNodeHandle(), "tables", SYNC_QUEUE);
  }

  void unsubscribe() override {
    cloud_sub_.unsubscribe();
    tables_sub_.unsubscribe();
  }

  bool wantedAnyway() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    return waiting_;
  }

  void onFrame(const CloudMessageConstPtr& cloud, const TableArrayConstPtr& tables) {
    attempt(cloud->header.stamp, [&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!waiting_ || !isSince(called_, cloud->header.stamp)) return;
      frame_ = {cloud, tables};
      arrived_.notify_all();
    });
  }

  bool onService(CaptureView::Request& request, CaptureView::Response& response) {
    try {
      capture(request, response);
      response.success = true;
    } catch (const std::exception& error) {
      response.reason = error.what();
      warn("nothing captured: " + response.reason);
    }
    return true;  // false would lose the reason
  }

  void capture(const CaptureView::Request& request, CaptureView::Response& response) {
    checkObjectName(request.name);
    if (request.timeout < ros::Duration(0))
      throw std::invalid_argument("timeout must not be negative, got " +
                                  std::to_string(request.timeout.toSec()) + " s");
    std::vector<std::string> names;
    if (std::filesystem::exists(file_))
      names = ObjectDatabase(file_, ObjectDatabase::Mode::READ).names();
    const bool known = std::count(names.begin(), names.end(), request.name) > 0;
    if (known && request.object_frame.empty())
      throw std::invalid_argument("object '" + request.name +
                                  "' has views already: without an object_frame this one has no "
                                  "place beside them; remove the object to begin anew");

    const auto deadline = Clock::now() + std::chrono::nanoseconds(request.timeout.isZero()
                                                                      ? DEFAULT_TIMEOUT.count()
                                                                      : request.timeout.toNSec());
    const Frame frame = nextFrame(deadline);
    TrainingView view;
    view.cloud = loneObject(*frame.cloud, *frame.tables, servedOptions(getNodeHandle()));
    if (!request.object_frame.empty())
      view.T_view_object =
          lookupTransformBy(Clock::now() + TF_WAIT, tf_, frame.cloud->header.frame_id,
                            request.object_frame, frame.cloud->header.stamp);
    else
      view.T_view_object.translation() =
          centroidOf(pointsAt(view.cloud, validIndices(view.cloud))).cast<double>();

    ObjectDatabase database(file_, ObjectDatabase::Mode::WRITE);
    const ObjectModel model =
        known ? withView(database.load(request.name), view)
              : trainFromViews(request.name, {view}, optionsOf(database, names), Progress());
    database.store(model);
    response.views = static_cast<std::uint32_t>(model.views.size());
    response.points = static_cast<std::uint32_t>(model.views.back().surface.size());
  }

  /// Those of the other objects: one file does not mix them.
  static DescriptorOptions optionsOf(const ObjectDatabase& database,
                                     const std::vector<std::string>& names) {
    return names.empty() ? DescriptorOptions() : database.load(names.front()).options;
  }

  /// The next frame whose cloud was taken from now on; throws with the reason when none comes.
  Frame nextFrame(Clock::time_point deadline) {
    setWaiting(true);
    std::unique_lock<std::mutex> lock(mutex_);
    const bool came =
        arrived_.wait_until(lock, deadline, [&] { return stopping_ || frame_.cloud; });
    const Frame frame = frame_;
    lock.unlock();
    const std::string inputs =
        frame.cloud ? ""
                    : inputsReport({cloud_sub_.getSubscriber(),
                                    tables_sub_.getSubscriber()});  // while they are subscribed
    setWaiting(false);
    if (!came || !frame.cloud) throw std::runtime_error("no frame came in time: " + inputs);
    return frame;
  }

  void setWaiting(bool waiting) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      waiting_ = waiting;
      frame_ = {};
      called_ = ros::Time::now();
    }
    updateSubscriptions();
  }

  using Policy = message_filters::sync_policies::ExactTime<CloudMessage, TableArray>;
  static constexpr std::chrono::nanoseconds DEFAULT_TIMEOUT = std::chrono::seconds(5);
  static constexpr std::chrono::milliseconds TF_WAIT{300};

  std::filesystem::path file_;
  std::mutex mutex_;  ///< guards what follows
  std::condition_variable arrived_;
  bool waiting_ = false, stopping_ = false;
  ros::Time called_;
  Frame frame_;

  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_{tf_};
  message_filters::Subscriber<CloudMessage> cloud_sub_;
  message_filters::Subscriber<TableArray> tables_sub_;
  message_filters::Synchronizer<Policy> sync_{Policy(SYNC_QUEUE), cloud_sub_, tables_sub_};

  ros::CallbackQueue service_queue_;
  ros::ServiceServer service_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::CaptureNodelet, nodelet::Nodelet)
