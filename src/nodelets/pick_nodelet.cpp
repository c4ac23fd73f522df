#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <future>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <geometry_msgs/PointStamped.h>
#include <message_filters/subscriber.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>
#include <ros/callback_queue.h>
#include <ros/spinner.h>
#include <sensor_msgs/CameraInfo.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "marker_messages.h"
#include "model_source.h"
#include "stage_nodelet.h"
#include "tabletop_perception/GraspConfig.h"
#include "tabletop_perception/PickConfig.h"
#include "tabletop_perception/pick_scene.h"
#include "tf_wait.h"

namespace tabletop_perception {
namespace {

using Clock = std::chrono::steady_clock;

/// Something that was pointed at and waits for the next frame.
struct Request {
  geometry_msgs::PointStamped point;
  bool pixel = false;
  std::string name;  ///< of the only object that counts; empty: all
  Clock::time_point deadline;
  bool click = false;  ///< by topic: another click takes its place
  std::function<void(const PickedObject&)> answer;
};

PickedObject refusal(const std_msgs::Header& header, const std::string& reason) {
  PickedObject message;
  message.header = header;
  message.reason = reason;
  message.pose.orientation.w = message.pregrasp.orientation.w = 1;
  return message;
}

/// What is sent in answer to a request.
struct Answer {
  PickedObject picked;
  /// Of the object that was recognised, in the cloud's frame; null without one.
  sensor_msgs::PointCloud2ConstPtr model;
  geometry_msgs::Pose model_frame;  ///< at the model's centroid, its axes those of the object

  Answer(PickedObject message) : picked(std::move(message)) {}  // NOLINT: without a model
};

}  // namespace

/// `/clicked_point` PointStamped in any frame, `~clicked_pixel` PointStamped with column and row as
/// x and y, `~camera_info` of the camera whose pixels they are (without any: those of the cloud),
/// and
/// `~cloud` PointCloud2 and `~tables` TableArray of one frame -> `~picked` PickedObject, `~markers`
/// MarkerArray, `~model` PointCloud2, `~grasps` PoseArray, tf frames `picked` and `pregrasp`;
/// service
/// `~estimate_pose_at`.
///
/// Every click is answered, within `timeout` [s]: what is in the next frame at that point, or why
/// nothing is. The frames are sent once, with the stamp of the cloud. Clouds are listened to only
/// while a click waits for one.
class PickNodelet : public StageNodelet {
 public:
  ~PickNodelet() override {
    if (spinner_) spinner_->stop();
  }

 private:
  void start() override {
    const auto database = parameter("database", std::string());
    if (!database.empty()) models_.emplace(database);
    timeout_ = parameter("timeout", 2.0);
    checkOption("timeout", timeout_, Range{0.1, 600});
    publish_tf_ = parameter("publish_tf", true);
    planning_frame_ = parameter("planning_frame", std::string());
    serveOptions<PickConfig>(getPrivateNodeHandle(), options_);
    serveOptions<GraspConfig>(ros::NodeHandle(getNodeHandle(), "grasp"), grasp_options_);

    auto& nh = getPrivateNodeHandle();
    picked_pub_ = nh.advertise<PickedObject>("picked", 5);
    markers_pub_ = nh.advertise<visualization_msgs::MarkerArray>("markers", 5);
    model_pub_ = nh.advertise<sensor_msgs::PointCloud2>("model", 5, true);
    grasps_pub_ = nh.advertise<geometry_msgs::PoseArray>("grasps", 5, true);
    sync_.registerCallback(&PickNodelet::onFrame, this);
    point_sub_ = nh.subscribe("/clicked_point", 5, &PickNodelet::onPoint, this);
    pixel_sub_ = nh.subscribe("clicked_pixel", 5, &PickNodelet::onPixel, this);
    info_sub_ = nh.subscribe("camera_info", 1, &PickNodelet::onInfo, this);
    timer_ = nh.createWallTimer(ros::WallDuration(0.05), &PickNodelet::onTimer, this);

    ros::NodeHandle service_nh(nh);
    service_nh.setCallbackQueue(&service_queue_);
    service_ = service_nh.advertiseService("estimate_pose_at", &PickNodelet::onService, this);
    spinner_ = std::make_unique<ros::AsyncSpinner>(SERVICE_THREADS, &service_queue_);
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
    std::lock_guard<std::mutex> lock(requests_mutex_);
    return !requests_.empty();
  }

  // --- what comes in

  void onPoint(const geometry_msgs::PointStampedConstPtr& point) { onClick(*point, false); }
  void onPixel(const geometry_msgs::PointStampedConstPtr& pixel) { onClick(*pixel, true); }
  void onInfo(const sensor_msgs::CameraInfoConstPtr& info) { info_ = info; }

  void onClick(const geometry_msgs::PointStamped& point, bool pixel) {
    Request request;
    request.point = point;
    request.pixel = pixel;
    request.click = true;
    request.deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                          std::chrono::duration<double>(timeout_));
    request.answer = [](const PickedObject&) {};
    for (const auto& older : take([](const Request& other) { return other.click; }))
      finish(older,
             refusal(older.point.header, "another point was clicked before the next cloud came"));
    add(std::move(request));
  }

  bool onService(EstimatePoseAt::Request& call, EstimatePoseAt::Response& response) {
    if (call.timeout < ros::Duration(0)) {
      response.reason =
          "timeout must not be negative, got " + std::to_string(call.timeout.toSec()) + " s";
      return true;
    }
    const auto answered = std::make_shared<std::promise<PickedObject>>();
    auto answer = answered->get_future();
    Request request;
    request.point = call.point;
    request.pixel = call.pixel;
    request.name = call.name;
    request.deadline =
        Clock::now() +
        std::chrono::nanoseconds(call.timeout.isZero() ? 5'000'000'000 : call.timeout.toNSec());
    request.answer = [answered](const PickedObject& picked) { answered->set_value(picked); };
    const auto last = request.deadline + std::chrono::seconds(5);  // for the work itself
    add(std::move(request));
    if (answer.wait_until(last) != std::future_status::ready) {
      response.reason = "the frame was not worked on in time";
      return true;
    }
    response.picked = answer.get();
    response.success = response.picked.success;
    response.reason = response.picked.reason;
    return true;
  }

  void onTimer(const ros::WallTimerEvent&) {
    const auto now = Clock::now();
    for (const auto& late : take([&](const Request& request) { return request.deadline <= now; }))
      finish(late, refusal(late.point.header, "no cloud came in time: " +
                                                  inputsReport({cloud_sub_.getSubscriber(),
                                                                tables_sub_.getSubscriber()})));
  }

  void onFrame(const CloudMessageConstPtr& cloud, const TableArrayConstPtr& tables) {
    attempt(cloud->header.stamp, [&] {
      for (const auto& request : take([](const Request&) { return true; })) {
        const Answer answer = answerTo(request, *cloud, *tables);
        health().setReason(answer.picked.reason);
        finish(request, answer);
      }
    });
  }

  Answer answerTo(const Request& request, const CloudMessage& cloud, const TableArray& tables) {
    try {
      return pick(request, cloud, tables);
    } catch (const std::exception& error) {
      return refusal(cloud.header, error.what());
    }
  }

  // --- requests

  void add(Request request) {
    {
      std::lock_guard<std::mutex> lock(requests_mutex_);
      requests_.push_back(std::move(request));
    }
    updateSubscriptions();
  }

  template <typename Condition>
  std::vector<Request> take(Condition condition) {
    std::vector<Request> taken;
    std::lock_guard<std::mutex> lock(requests_mutex_);
    for (auto request = requests_.begin(); request != requests_.end();) {
      if (!condition(*request)) {
        ++request;
        continue;
      }
      taken.push_back(std::move(*request));
      request = requests_.erase(request);
    }
    return taken;
  }

  void finish(const Request& request, const Answer& answer) {
    const PickedObject& picked = answer.picked;
    if (!picked.success) warn("nothing picked: " + picked.reason);
    picked_pub_.publish(picked);
    markers_pub_.publish(pickMarkers(picked, options_.depth));
    publishGrasps(picked.object);
    model_pub_.publish(answer.model ? *answer.model
                                    : *messageFromCloud(Cloud(0, 1, false), picked.header));
    if (picked.success && publish_tf_) sendFrames(answer);
    request.answer(picked);
    updateSubscriptions();
  }

  void sendFrames(const Answer& answer) {
    const auto& header = answer.picked.header;
    std::vector<geometry_msgs::TransformStamped> frames = {
        transformMessage(answer.picked.pose, header, "picked"),
        transformMessage(answer.picked.pregrasp, header, "pregrasp")};
    if (answer.model)
      frames.push_back(transformMessage(answer.model_frame, header, "picked_model"));
    tf_broadcaster_.sendTransform(frames);
  }

  /// Of what was picked, in the planning frame; an empty array where it has none or cannot be moved
  /// there.
  void publishGrasps(RecognizedObject object) {
    for (const auto& grasp : object.grasps)
      if (!grasp.reason.empty()) warn("grasp " + grasp.name + " left out: " + grasp.reason);
    try {
      if (!planning_frame_.empty() && !object.grasps.empty()) {
        const auto T_planning_camera =
            lookupTransformBy(Clock::now() + TF_WAIT, tf_, planning_frame_, object.header.frame_id,
                              object.header.stamp);
        object = movedTo(planning_frame_, T_planning_camera, std::move(object));
      }
    } catch (const tf2::TransformException& error) {
      warn("no grasps in the planning frame '" + planning_frame_ + "': " + error.what());
      object.grasps.clear();
    }
    grasps_pub_.publish(usableGrasps(object));
  }

  // --- the work

  Answer pick(const Request& request, const CloudMessage& message, const TableArray& tables) {
    const PipelineOptions options = currentOptions();
    if (tables.tables.empty()) return refusal(message.header, "no table: " + tables.reason);
    const Cloud& cloud = message.cloud();
    const auto point = request.pixel ? pointOfPixel(request, cloud, message.header, options)
                                     : pointInCloud(request.point, message.header);
    if (!point) return refusal(message.header, point.reason);
    auto pick = pickThing(cloud, *point, tablesFromMessage(tables), options);
    if (!pick) return refusal(message.header, pick.reason);
    *pick.value = atFullResolution(cloud, std::move(*pick.value));

    SceneObject object =
        unknownObject(pick->window.cloud, pick->thing(), 2, std::optional<Table>(pick->table));
    if (!models_) return filled(*pick, object, message.header);

    const ModelIndex& known = models_->update();
    std::optional<ModelIndex> single;
    if (!request.name.empty()) single.emplace(onlyModel(known, request.name));
    const ModelIndex& index = single ? *single : known;
    object = recognizePick(*pick, index, options);
    const int model = index.find(object.name);
    if (model < 0) return filled(*pick, object, message.header);
    const Surface& surface = index.models()[model].surface;
    completePick(*pick.value, index.models()[model], object.T_camera_object, options.grasp);

    Answer answer = filled(*pick, object, message.header);
    auto& picked = answer.picked.object;
    addGrasps(graspsOf(object, {pick->table}, index, options.grasp), picked);
    RecognizedObjectArray alone;
    alone.objects = {picked};
    answer.model = messageFromCloud(modelsAtPoses(alone, index), message.header);
    answer.model_frame = messageFromPose(
        object.T_camera_object * Eigen::Translation3d(centroidOf(surface.points).cast<double>()));
    return answer;
  }

  ModelIndex onlyModel(const ModelIndex& index, const std::string& name) const {
    const int model = index.find(name);
    if (model < 0)
      throw std::invalid_argument("no object '" + name + "' in database " +
                                  models_->file().string());
    return ModelIndex(std::vector<ObjectModel>{index.models()[model]});
  }

  static PickedObject filled(const Pick& pick, const SceneObject& object,
                             const std_msgs::Header& header) {
    PickedObject message;
    message.header = header;
    message.success = true;
    message.reason = object.reason;
    message.point = messageFromPoint(pick.point.cast<double>());
    message.pose = messageFromPose(pick.surface.T_camera_pick);
    std::copy_n(pick.surface.extents.data(), 2, message.extents.begin());
    std::copy_n(pick.table.plane.data(), 4, message.plane.begin());
    message.pregrasp = messageFromPose(pick.pregrasp.T_camera_gripper);
    message.width = pick.pregrasp.width;
    message.object = messageFromObject(object, 1, header);
    message.object.child_frame_id.clear();  // only refine sends the frames of objects
    return message;
  }

  /// The options of the other stages as their nodelets serve them.
  PipelineOptions currentOptions() {
    PipelineOptions options = servedOptions(getNodeHandle());
    options.pick = options_;
    options.grasp = grasp_options_;
    return options;
  }

  Found<Eigen::Vector3f> pointOfPixel(const Request& request, const Cloud& cloud,
                                      const std_msgs::Header& header,
                                      const PipelineOptions& options) const {
    const Eigen::Vector2d pixel(request.point.point.x, request.point.point.y);
    const bool own = !info_ || (static_cast<int>(info_->width) == cloud.width &&
                                static_cast<int>(info_->height) == cloud.height);
    if (own) return pointAtPixel(cloud, pixel, options.pick.pixel_window);
    if (info_->header.frame_id != header.frame_id)
      return Found<Eigen::Vector3f>::none("camera_info is of frame '" + info_->header.frame_id +
                                          "', the cloud of '" + header.frame_id + "'");
    return pointAtPixel(cloud, projectionOf(*info_), pixel, options.pick.pixel_window);
  }

  /// The point in the cloud's frame. What it was clicked in is taken to stand still.
  Found<Eigen::Vector3f> pointInCloud(const geometry_msgs::PointStamped& point,
                                      const std_msgs::Header& cloud) const {
    using FoundPoint = Found<Eigen::Vector3f>;
    const Eigen::Vector3d p = pointFromMessage(point.point);
    if (!p.allFinite()) return FoundPoint::none("the point is not finite");
    const double age = point.header.stamp.isZero() ? 0 : (cloud.stamp - point.header.stamp).toSec();
    if (std::abs(age) > MAX_AGE) {
      char text[120];
      std::snprintf(text, sizeof text, "the point is %.1f s %s than the cloud, tf knows %.0f s",
                    std::abs(age), age > 0 ? "older" : "younger", MAX_AGE);
      return FoundPoint::none(text);
    }
    if (point.header.frame_id == cloud.frame_id) return Eigen::Vector3f(p.cast<float>());
    try {
      const auto T_cloud_point = lookupTransformBy(Clock::now() + TF_WAIT, tf_, cloud.frame_id,
                                                   point.header.frame_id, cloud.stamp);
      return Eigen::Vector3f((T_cloud_point * p).cast<float>());
    } catch (const tf2::TransformException& error) {
      return FoundPoint::none("the point's frame '" + point.header.frame_id +
                              "' cannot be used: " + error.what());
    }
  }

  using Policy = message_filters::sync_policies::ExactTime<CloudMessage, TableArray>;
  static constexpr double MAX_AGE = 10;  ///< of a point: the length of tf's memory [s]
  static constexpr std::chrono::milliseconds TF_WAIT{300};
  static constexpr int SERVICE_THREADS = 4;

  PickOptions options_;
  GraspOptions grasp_options_;
  double timeout_ = 2;
  bool publish_tf_ = true;
  std::string planning_frame_;  ///< of the grasps; empty: the cloud's
  std::optional<ModelSource> models_;
  sensor_msgs::CameraInfoConstPtr info_;

  std::mutex requests_mutex_;
  std::list<Request> requests_;

  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_{tf_};
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  ros::Publisher picked_pub_, markers_pub_, model_pub_, grasps_pub_;
  ros::Subscriber point_sub_, pixel_sub_, info_sub_;
  ros::WallTimer timer_;
  message_filters::Subscriber<CloudMessage> cloud_sub_;
  message_filters::Subscriber<TableArray> tables_sub_;
  message_filters::Synchronizer<Policy> sync_{Policy(SYNC_QUEUE), cloud_sub_, tables_sub_};

  ros::CallbackQueue service_queue_;
  ros::ServiceServer service_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::PickNodelet, nodelet::Nodelet)
