#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <message_filters/subscriber.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/synchronizer.h>
#include <ros/callback_queue.h>
#include <ros/spinner.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "model_source.h"
#include "stage_nodelet.h"
#include "tabletop_perception/RefineConfig.h"
#include "tabletop_perception/TrackConfig.h"
#include "tabletop_perception/VerifyConfig.h"
#include "tabletop_perception/object_memory.h"
#include "tabletop_perception/pick_scene.h"
#include "tabletop_perception/pipeline.h"
#include "tabletop_perception/tracker.h"
#include "tf_wait.h"

namespace tabletop_perception {
namespace {

using Clock = std::chrono::steady_clock;

/// Why a frame has no object, or none with a name; empty if neither is to be said.
std::string frameReason(const TableArray& tables, const CandidateArray& candidates,
                        const CloudMessage& clusters) {
  if (!tables.reason.empty()) return tables.reason;
  if (!candidates.clusters.empty()) return candidates.reason;
  const auto standing = validIndices(clusters.cloud()).size();
  return standing == 0 ? "nothing stands on the table"
                       : "none of the groups of the " + std::to_string(standing) +
                             " points on the table is large enough for an object";
}

/// The names of what is on the table, for people.
std::string namesOf(const RecognizedObjectArray& frame) {
  std::string names;
  for (const auto& object : frame.objects) {
    names += (names.empty() ? "" : ", ") + object.name;
    if (!object.reason.empty()) names += " (" + object.reason + ")";
  }
  return names;
}

}  // namespace

/// `~candidates` CandidateArray and `~clusters` PointCloud2 with labels from match, `~tables`
/// TableArray, and `~cloud`, the filtered PointCloud2 of the whole scene -> `~objects`
/// RecognizedObjectArray and a tf frame per object; service `~get_object_pose` GetObjectPose, with
/// whose answers `~grasps` PoseArray goes. Every frame is answered, also one without a table or an
/// object.
///
/// Parameters: `database`, the file with the objects; `publish_tf`; `track_frame`, the tf frame in
/// which things at rest do not move (empty: the camera's, which then must not move either). The
/// options of verify, track and grasp live in the namespaces of these names beside this nodelet, as
/// their sections of the yaml file do; those of match are the match nodelet's, in the namespace
/// `match` beside this one.
class RefineNodelet : public StageNodelet {
 public:
  ~RefineNodelet() override {
    {
      std::lock_guard<std::mutex> lock(latest_mutex_);
      stopping_ = true;
    }
    latest_changed_.notify_all();
    if (spinner_) spinner_->stop();
  }

 private:
  void start() override {
    models_.emplace(parameter("database", std::string("~/.ros/tabletop.db")));
    publish_tf_ = parameter("publish_tf", true);
    track_frame_ = parameter("track_frame", std::string());
    serveOptions<RefineConfig>(getPrivateNodeHandle(), options_.refine);
    serveOptions<VerifyConfig>(ros::NodeHandle(getNodeHandle(), "verify"), options_.verify);
    followOptions("match", options_.match);
    serveOptions<TrackConfig>(ros::NodeHandle(getNodeHandle(), "track"), options_.track);

    // Now, and not with the first frame: who calls a graph that sleeps would wait for it.
    reading_ = getPrivateNodeHandle().createWallTimer(
        ros::WallDuration(0.01), [this](const auto&) { models(); }, true);

    sync_.registerCallback(&RefineNodelet::onFrame, this);
    objects_pub_ = advertise<RecognizedObjectArray>("objects");
    grasps_pub_ = getPrivateNodeHandle().advertise<geometry_msgs::PoseArray>("grasps", 5, true);

    // A waiting call must not hold up the frames it waits for: a queue and threads of its own.
    ros::NodeHandle service_nh(getPrivateNodeHandle());
    service_nh.setCallbackQueue(&service_queue_);
    service_ = service_nh.advertiseService("get_object_pose", &RefineNodelet::onService, this);
    spinner_ = std::make_unique<ros::AsyncSpinner>(SERVICE_THREADS, &service_queue_);
    spinner_->start();
  }

  void subscribe() override {
    auto& nh = getPrivateNodeHandle();
    cloud_sub_.subscribe(nh, "cloud", SYNC_QUEUE);
    tables_sub_.subscribe(nh, "tables", SYNC_QUEUE);
    clusters_sub_.subscribe(nh, "clusters", SYNC_QUEUE);
    candidates_sub_.subscribe(nh, "candidates", SYNC_QUEUE);
  }

  void unsubscribe() override {
    cloud_sub_.unsubscribe();
    tables_sub_.unsubscribe();
    clusters_sub_.unsubscribe();
    candidates_sub_.unsubscribe();
  }

  bool wantedAnyway() override { return publish_tf_ || calls_ > 0; }

  /// What the database holds by now.
  const ModelIndex& models() {
    const ModelIndex& index = models_->update();
    health().setValue("objects known", std::to_string(index.models().size()));
    return index;
  }

  void onFrame(const CandidateArrayConstPtr& candidates, const CloudMessageConstPtr& clusters,
               const TableArrayConstPtr& tables,
               const ros::MessageEvent<const CloudMessage>& cloud) {
    attempt(candidates->header.stamp, [&] {
      const ModelIndex& index = models();
      const auto standing_on = tablesFromMessage(*tables);
      forgetOtherFrames(candidates->header.frame_id);
      const Eigen::Isometry3d T_track_camera = cameraInTrackFrame(candidates->header);
      const double stamp = candidates->header.stamp.toSec();
      auto objects =
          decideScene(*cloud.getConstMessage(), *clusters, *candidates, standing_on, index,
                      memory_.expected(stamp, T_track_camera, options_.refine.keep));
      const auto tracked = track(objects, index, T_track_camera, candidates->header.stamp);
      memory_.remember(stamp, T_track_camera, objects);

      auto message = boost::make_shared<RecognizedObjectArray>();
      message->header = candidates->header;
      message->reason = frameReason(*tables, *candidates, *clusters);
      health().setReason(message->reason);
      for (std::size_t i = 0; i < objects.size(); ++i) {
        message->objects.push_back(messageFromObject(objects[i], tracked[i].id, message->header));
        message->objects.back().confirmed = tracked[i].confirmed;
      }
      for (std::size_t i = 0; i < objects.size(); ++i)
        if (hasGrasps(objects[i], index))
          addGrasps(graspsOf(objects[i], standing_on, index, graspOptions()), message->objects[i]);

      objects_pub_.publish(message);
      if (publish_tf_) sendTransforms(*message, T_track_camera);
      {
        std::lock_guard<std::mutex> lock(latest_mutex_);
        latest_ = {message, cloud.getReceiptTime()};
      }
      latest_changed_.notify_all();
    });
  }

  std::vector<SceneObject> decideScene(const CloudMessage& cloud_message,
                                       const CloudMessage& clusters_message,
                                       const CandidateArray& candidates,
                                       const std::vector<Table>& tables, const ModelIndex& index,
                                       const std::vector<SceneObject>& expected) {
    const Cloud& scene = cloud_message.cloud();
    const auto& labels = clusters_message.labels();
    if (labels.size() != scene.size())
      throw std::invalid_argument("clusters of " + std::to_string(labels.size()) +
                                  " points do not belong to a cloud of " +
                                  std::to_string(scene.size()));
    const auto clusters = clustersOf(labels);
    std::vector<Proposal> proposals;
    for (const auto& entry : candidates.clusters)
      proposals.push_back(proposalFromMessage(entry, clusters.size()));
    return decideObjects(scene, clusters, proposals, tables, index, options_.match, options_.refine,
                         options_.verify, expected);
  }

  static bool hasGrasps(const SceneObject& object, const ModelIndex& index) {
    const int model = index.find(object.name);
    return model >= 0 && !index.models()[model].grasps.empty();
  }

  /// As the pick nodelet serves them.
  GraspOptions graspOptions() const {
    GraspOptions options;
    readOptions(getNodeHandle(), "grasp", options);
    return options;
  }

  /// What is remembered is in the frame of the clouds, unless track_frame is set: it would be sent
  /// in a wrong one when that changes. Ids count on.
  void forgetOtherFrames(const std::string& frame) {
    if (frame == cloud_frame_) return;
    if (track_frame_.empty() && !cloud_frame_.empty()) {
      warn("clouds come in the frame " + frame + " now, before in " + cloud_frame_ +
           ": what was seen there is forgotten (track_frame would keep it)");
      memory_ = {};
      tracker_.update(std::numeric_limits<double>::infinity(), {});  // after all memory
    }
    cloud_frame_ = frame;
  }

  /// Where the camera was in the frame that things are tracked in. Throws when tf does not know.
  Eigen::Isometry3d cameraInTrackFrame(const std_msgs::Header& header) const {
    if (track_frame_.empty()) return Eigen::Isometry3d::Identity();
    return lookupTransformBy(Clock::now() + TRACK_FRAME_TIMEOUT, tf_, track_frame_, header.frame_id,
                             header.stamp);
  }

  /// Tells the objects apart from those of other frames, and makes their poses the filtered ones.
  std::vector<TrackedThing> track(std::vector<SceneObject>& objects, const ModelIndex& index,
                                  const Eigen::Isometry3d& T_track_camera, const ros::Time& stamp) {
    std::vector<Sighting> sightings;
    for (const auto& object : objects) {
      const int model = index.find(object.name);
      sightings.push_back({object.name, T_track_camera * object.T_camera_object,
                           turnedCovariance(object.uncertainty.covariance, T_track_camera.linear()),
                           model < 0 ? Symmetry() : index.models()[model].symmetry,
                           T_track_camera * object.box.T_camera_box.translation(),
                           object.evidence.turn, !object.followed});
    }
    tracker_.setOptions(options_.track);
    const auto things = tracker_.update(stamp.toSec(), sightings);
    const Eigen::Isometry3d T_camera_track = T_track_camera.inverse();
    for (std::size_t i = 0; i < objects.size(); ++i) {
      objects[i].T_camera_object = T_camera_track * things[i].T_world_object;
      objects[i].uncertainty.covariance =
          turnedCovariance(things[i].covariance, T_camera_track.linear());
    }
    return things;
  }

  /// Frames of what is confirmed, seen or missed for a moment.
  void sendTransforms(const RecognizedObjectArray& frame, const Eigen::Isometry3d& T_track_camera) {
    std::vector<geometry_msgs::TransformStamped> transforms;
    for (const auto& object : frame.objects)
      if (object.confirmed)
        transforms.push_back(transformMessage(object.pose, frame.header, object.child_frame_id));
    for (const auto& thing : tracker_.missed())
      transforms.push_back(
          transformMessage(messageFromPose(T_track_camera.inverse() * thing.T_world_object),
                           frame.header, objectFrame(thing.name, thing.id)));
    tf_broadcaster_.sendTransform(transforms);
  }

  bool onService(GetObjectPose::Request& request, GetObjectPose::Response& response) {
    try {
      response.objects = answer(request, response.reason);
      publishGrasps(response.objects);
    } catch (const std::exception& error) {
      response.reason = error.what();
    }
    response.success = !response.objects.empty();
    return true;  // false would lose the reason
  }

  /// Those of the best known object in an answer; an empty array where there is none.
  void publishGrasps(const std::vector<RecognizedObject>& objects) {
    const auto best = std::find_if(objects.begin(), objects.end(),
                                   [](const auto& object) { return object.name != "unknown"; });
    grasps_pub_.publish(best == objects.end() ? geometry_msgs::PoseArray() : usableGrasps(*best));
  }

  /// The objects that a call asks for; none, with the reason, is an answer too.
  std::vector<RecognizedObject> answer(const GetObjectPose::Request& request, std::string& reason) {
    if (request.timeout < ros::Duration(0))
      throw std::invalid_argument("timeout must not be negative, got " +
                                  std::to_string(request.timeout.toSec()) + " s");
    const std::chrono::nanoseconds timeout(
        request.timeout.isZero() ? DEFAULT_TIMEOUT
                                 : std::chrono::nanoseconds(request.timeout.toNSec()));
    const auto deadline = Clock::now() + timeout;
    checkName(request.name);

    const auto frame = nextFrame(deadline);
    reason = frame->reason;
    auto objects = frame->objects;
    objects.erase(std::remove_if(objects.begin(), objects.end(),
                                 [&](const RecognizedObject& object) {
                                   return !request.name.empty() && object.name != request.name;
                                 }),
                  objects.end());
    if (objects.empty() && reason.empty())
      reason = request.name + " is not in view; on the table: " + namesOf(*frame);
    std::stable_sort(objects.begin(), objects.end(),
                     [](const auto& a, const auto& b) { return a.score > b.score; });
    return request.target_frame.empty() ? objects
                                        : inFrame(request.target_frame, objects, deadline);
  }

  /// Throws unless the database knows an object of that name.
  void checkName(const std::string& name) const {
    if (name.empty() || name == "unknown") return;
    const auto names = ObjectDatabase(models_->file(), ObjectDatabase::Mode::READ).names();
    if (std::find(names.begin(), names.end(), name) != names.end()) return;
    std::string list;
    for (const auto& known : names) list += (list.empty() ? "" : ", ") + known;
    throw std::invalid_argument("no object '" + name + "' in database " + models_->file().string() +
                                "; it holds " + (names.empty() ? "no object" : list));
  }

  /// The next frame whose cloud arrives from now on; throws with the reason when none comes. Wakes
  /// the graph up if it sleeps.
  RecognizedObjectArrayConstPtr nextFrame(Clock::time_point deadline) {
    const ros::Time called = ros::Time::now();
    ++calls_;
    updateSubscriptions();
    const auto frame = frameSince(called, deadline);
    const std::string inputs =
        frame ? ""
              : inputsReport({cloud_sub_.getSubscriber(), tables_sub_.getSubscriber(),
                              candidates_sub_.getSubscriber()});  // while they are subscribed
    --calls_;
    updateSubscriptions();
    if (!frame) throw std::runtime_error("no frame came through in time: " + inputs);
    return frame;
  }

  /// Null if there is none by the deadline.
  RecognizedObjectArrayConstPtr frameSince(ros::Time called, Clock::time_point deadline) {
    std::unique_lock<std::mutex> lock(latest_mutex_);
    const auto before = latest_.objects;
    const auto arrived = [&] {
      return stopping_ || (latest_.objects != before && isSince(called, latest_.received));
    };
    const bool came = latest_changed_.wait_until(lock, deadline, arrived);
    return came && !stopping_ ? latest_.objects : nullptr;
  }

  std::vector<RecognizedObject> inFrame(const std::string& target_frame,
                                        std::vector<RecognizedObject> objects,
                                        Clock::time_point deadline) const {
    if (objects.empty()) return objects;
    const auto& header = objects.front().header;
    const auto T_target_camera =
        lookupTransformBy(deadline, tf_, target_frame, header.frame_id, header.stamp);
    for (auto& object : objects) object = movedTo(target_frame, T_target_camera, object);
    return objects;
  }

  using Policy = message_filters::sync_policies::ExactTime<CandidateArray, CloudMessage, TableArray,
                                                           CloudMessage>;
  static constexpr int SERVICE_THREADS = 4;  ///< calls that wait at the same time
  static constexpr std::chrono::milliseconds TRACK_FRAME_TIMEOUT{200};
  static constexpr std::chrono::seconds DEFAULT_TIMEOUT{5};

  PipelineOptions options_;  ///< match, refine, verify and track count
  bool publish_tf_ = true;
  std::string track_frame_;
  std::string cloud_frame_;  ///< of the last frame
  std::optional<ModelSource> models_;
  ObjectMemory memory_;
  Tracker tracker_;

  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener tf_listener_{tf_};
  tf2_ros::TransformBroadcaster tf_broadcaster_;
  ros::Publisher objects_pub_, grasps_pub_;
  message_filters::Subscriber<CandidateArray> candidates_sub_;
  message_filters::Subscriber<CloudMessage> clusters_sub_;
  message_filters::Subscriber<TableArray> tables_sub_;
  message_filters::Subscriber<CloudMessage> cloud_sub_;
  message_filters::Synchronizer<Policy> sync_{Policy(SYNC_QUEUE), candidates_sub_, clusters_sub_,
                                              tables_sub_, cloud_sub_};

  /// The last frame that came through, and when its cloud came here.
  struct Latest {
    RecognizedObjectArrayConstPtr objects;
    ros::Time received;
  };
  std::mutex latest_mutex_;
  std::condition_variable latest_changed_;
  Latest latest_;
  bool stopping_ = false;

  std::atomic<int> calls_{0};  ///< that wait for a frame
  ros::CallbackQueue service_queue_;
  ros::ServiceServer service_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
  ros::WallTimer reading_;  ///< last: when it goes it waits for what it called
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::RefineNodelet, nodelet::Nodelet)
