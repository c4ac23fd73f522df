#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <mutex>
#include <optional>
#include <thread>

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/distortion_models.h>
#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "color_partner.h"
#include "conversions.h"
#include "device_clock.h"
#include "lasting_thread.h"
#include "openni_camera.h"
#include "stage_nodelet.h"
#include "tabletop_perception/OpenniConfig.h"

namespace tabletop_perception {
namespace {

sensor_msgs::ImagePtr messageFromImage(const PackedImage& image, const std_msgs::Header& header) {
  const auto message = boost::make_shared<sensor_msgs::Image>();
  message->header = header;
  message->encoding = image.encoding;
  message->width = image.width;
  message->height = image.height;
  message->step = image.step;
  message->data.assign(image.data, image.data + image.data_size);
  return message;
}

/// The same depths as 32FC1.
sensor_msgs::ImagePtr inMetres(const sensor_msgs::Image& depth) {
  const auto message = boost::make_shared<sensor_msgs::Image>();
  message->header = depth.header;
  message->encoding = "32FC1";
  message->width = depth.width;
  message->height = depth.height;
  message->step = depth.width * sizeof(float);
  const auto depths = depthsInMetres(packedView(depth));
  message->data.resize(depths.size() * sizeof(float));
  std::memcpy(message->data.data(), depths.data(), message->data.size());
  return message;
}

sensor_msgs::CameraInfoPtr messageFromCamera(const Projection& camera,
                                             const std_msgs::Header& header) {
  const auto message = boost::make_shared<sensor_msgs::CameraInfo>();
  message->header = header;
  message->width = camera.width;
  message->height = camera.height;
  message->distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  message->D.assign(5, 0);
  message->K = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  message->R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  message->P = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  return message;
}

bool heard(const ros::Publisher& publisher) { return publisher.getNumSubscribers() > 0; }

}  // namespace

/// An OpenNI2 camera or .oni file -> `~rgb/image_raw` Image (rgb8), `~rgb/camera_info` CameraInfo;
/// with `registration` `~depth_registered/` `image_raw` Image (16UC1 [mm]), `image` Image (32FC1
/// [m]), `camera_info` CameraInfo and `points` PointCloud2 with colours, in `rgb_frame`; without,
/// `~depth/` `image_raw`, `image` and `camera_info`, in `depth_frame`.
///
/// A thread of its own opens the camera, waits for its images and publishes them; a camera that is
/// not there, or goes, is looked for every second. The streams run while somebody listens.
class OpenniNodelet : public StageNodelet {
 public:
  ~OpenniNodelet() override {
    stop_ = true;
    thread_.reset();
  }

 private:
  void start() override {
    device_ = parameter("device", device_);
    rgb_frame_ = parameter("rgb_frame", rgb_frame_);
    depth_frame_ = parameter("depth_frame", depth_frame_);
    library_.emplace();
    serveOptions<OpenniConfig>(getPrivateNodeHandle(), options_, [this] {
      std::lock_guard<std::mutex> lock(asked_mutex_);
      asked_ = options_;
    });
    rgb_ = advertiseImages("rgb");
    depth_ = advertiseImages("depth");
    depth_.metres = advertise<sensor_msgs::Image>("depth/image");
    registered_ = advertiseImages("depth_registered");
    registered_.metres = advertise<sensor_msgs::Image>("depth_registered/image");
    points_pub_ = advertise<CloudMessage>("depth_registered/points");
    thread_.emplace([this] { run(); });
  }

  // What is listened to is looked at before every image.
  void subscribe() override {}
  void unsubscribe() override {}

  struct ImageTopics {
    ros::Publisher raw, metres, info;  ///< metres: of depth only
    bool heard() const {
      return tabletop_perception::heard(raw) || tabletop_perception::heard(info) ||
             tabletop_perception::heard(metres);
    }
  };

  ImageTopics advertiseImages(const std::string& name) {
    return {advertise<sensor_msgs::Image>(name + "/image_raw"),
            {},
            advertise<sensor_msgs::CameraInfo>(name + "/camera_info")};
  }

  // --- the camera's thread

  void run() {
    while (!stop_) try {
        if (!camera_) open();
        step();
      } catch (const std::exception& error) {
        camera_.reset();
        health().dropped(error.what());
        warn(error.what());
        pause(RETRY);
      }
  }

  OpenniOptions asked() {
    std::lock_guard<std::mutex> lock(asked_mutex_);
    return asked_;
  }

  void open() {
    used_ = asked();
    camera_.emplace(device_, used_);
    setExposure();
    NODELET_INFO("%s: opened %s", getName().c_str(), camera_->name().c_str());
    clock_ = {};
    partner_ = ColorPartner(PAIR_INTERVAL);
    last_image_ = Clock::now();
  }

  void setExposure() {
    const auto refused = camera_->setExposure(used_);
    if (!refused.empty()) warn("camera " + camera_->name() + " does not take: " + refused);
  }

  void step() {
    const auto options = asked();
    if (!sameStreams(options, used_)) return camera_.reset();
    const bool new_exposure = !sameExposure(options, used_);
    used_ = options;
    if (new_exposure) setExposure();

    const bool wants_points = heard(points_pub_) && used_.registration;
    const bool wants_depth = wants_points || depthTopics().heard();
    const bool wants_color = camera_->hasColor() && (wants_points || rgb_.heard());
    warnOfSilence();
    camera_->stream(wants_depth, wants_color);
    if (!wants_depth && !wants_color) {
      camera_->checkConnected();
      last_image_ = Clock::now();
      return pause(IDLE);
    }
    const auto frame = camera_->read(IDLE);
    if (frame) {
      last_image_ = Clock::now();
      const auto start = Clock::now();
      const ros::Time stamp = publish(*frame, wants_color);
      if (frame->depth || !wants_depth) health().answered(stamp, Clock::now() - start);
    } else if (Clock::now() - last_image_ > SILENCE) {
      throw std::runtime_error("camera " + camera_->name() + " sends no images, opened anew");
    }
  }

  const ImageTopics& depthTopics() const { return used_.registration ? registered_ : depth_; }

  /// Topics that nothing will come on.
  void warnOfSilence() {
    if (used_.registration && depth_.heard())
      warn("registration is on: depth comes on depth_registered, nothing on depth");
    if (!used_.registration && (registered_.heard() || heard(points_pub_)))
      warn("registration is off: depth comes on depth, nothing on depth_registered");
    if (!camera_->hasColor() && rgb_.heard())
      warn("camera " + camera_->name() + " has no colour, nothing comes on rgb");
  }

  /// Gives back when the image was taken.
  ros::Time publish(const OpenniFrame& frame, bool color_comes) {
    std_msgs::Header header;
    const bool by_color = !frame.depth || used_.registration;
    header.frame_id = by_color ? rgb_frame_ : depth_frame_;
    header.stamp.fromSec(clock_.onHost(frame.time_us, ros::Time::now().toSec()));
    const auto image = messageFromImage(frame.image, header);
    const auto& topics = frame.depth ? depthTopics() : rgb_;
    topics.info.publish(messageFromCamera(frame.camera, header));
    topics.raw.publish(image);
    if (heard(topics.metres)) topics.metres.publish(inMetres(*image));
    if (!heard(points_pub_) || !used_.registration) return header.stamp;
    for (const auto& [depth, color] :
         frame.depth ? partner_.addDepth(image, color_comes) : partner_.addColor(image))
      publishPoints(*depth, color.get(), frame.camera);
    return header.stamp;
  }

  void publishPoints(const sensor_msgs::Image& depth, const sensor_msgs::Image* color,
                     const Projection& camera) {
    const auto packed_color = color ? packedView(*color) : PackedImage();
    points_pub_.publish(boost::make_shared<CloudMessage>(
        depth.header, cloudFromDepth(packedView(depth), color ? &packed_color : nullptr, camera,
                                     DepthImageOptions())));
  }

  void pause(std::chrono::milliseconds time) {
    const auto end = Clock::now() + time;
    while (!stop_ && Clock::now() < end) std::this_thread::sleep_for(std::min(time, IDLE));
  }

  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds IDLE{50};
  static constexpr std::chrono::milliseconds RETRY{1000};
  static constexpr std::chrono::seconds SILENCE{3};
  const ros::Duration PAIR_INTERVAL{0.02};  ///< farthest that stamps of depth and colour differ

  std::string device_, rgb_frame_ = "camera_rgb_optical_frame",
                       depth_frame_ = "camera_depth_optical_frame";
  OpenniOptions options_;  ///< as served; the thread takes them from asked_
  ImageTopics rgb_, depth_, registered_;
  ros::Publisher points_pub_;

  std::mutex asked_mutex_;
  OpenniOptions asked_;

  std::optional<OpenniLibrary> library_;
  std::optional<OpenniCamera> camera_;  ///< the thread's, as what follows
  OpenniOptions used_;
  DeviceClock clock_;
  ColorPartner partner_{PAIR_INTERVAL};
  Clock::time_point last_image_;

  std::atomic<bool> stop_{false};
  std::optional<LastingThread> thread_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::OpenniNodelet, nodelet::Nodelet)
