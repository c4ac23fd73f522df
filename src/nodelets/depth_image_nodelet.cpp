#include <optional>
#include <stdexcept>
#include <vector>

#include <boost/make_shared.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "color_partner.h"
#include "conversions.h"
#include "image_codec.h"
#include "stage_nodelet.h"
#include "tabletop_perception/DepthImageConfig.h"
#include "tabletop_perception/depth_image.h"

namespace tabletop_perception {

/// `~depth` Image (16UC1 in mm or 32FC1 in m), `~color` Image of the same view, if somebody sends
/// it, and `~camera_info` CameraInfo of both -> `~cloud` PointCloud2, organised, with the depth
/// image's stamp and frame.
///
/// With the parameter `compressed` it takes `~depth/compressedDepth` and `~color/compressed`, as
/// image_transport names them.
///
/// Of `~camera_info` the last one counts, so that one that is sent once or seldom will do.
class DepthImageNodelet : public StageNodelet {
  void start() override {
    compressed_ = parameter("compressed", compressed_);
    interval_ = parameter("color_interval", interval_);
    if (!(interval_ >= 0 && interval_ <= 1))
      throw std::invalid_argument("color_interval must be between 0 and 1, got " +
                                  std::to_string(interval_));
    serveOptions<DepthImageConfig>(getPrivateNodeHandle(), options_);
    cloud_pub_ = advertise<CloudMessage>("cloud");
  }

  void subscribe() override {
    auto& nh = getPrivateNodeHandle();
    partner_.emplace(ros::Duration(interval_));
    memory_ = {};
    info_sub_ = nh.subscribe("camera_info", 1, &DepthImageNodelet::onInfo, this);
    if (compressed_) {
      color_sub_ = nh.subscribe(nh.resolveName("color") + "/compressed", INNER_QUEUE,
                                &DepthImageNodelet::onCompressedColor, this);
      depth_sub_ = nh.subscribe(nh.resolveName("depth") + "/compressedDepth", 1,
                                &DepthImageNodelet::onCompressedDepth, this);
      return;
    }
    color_sub_ = nh.subscribe("color", INNER_QUEUE, &DepthImageNodelet::onColor, this);
    depth_sub_ = nh.subscribe("depth", 1, &DepthImageNodelet::onDepth, this);
  }

  void unsubscribe() override {
    for (auto* subscriber : {&info_sub_, &color_sub_, &depth_sub_}) subscriber->shutdown();
  }

  void onInfo(const sensor_msgs::CameraInfoConstPtr& info) { info_ = info; }

  void onCompressedColor(const sensor_msgs::CompressedImageConstPtr& color) {
    if (const auto image = unpacked(*color)) onColor(image);
  }

  void onCompressedDepth(const sensor_msgs::CompressedImageConstPtr& depth) {
    if (const auto image = unpacked(*depth)) onDepth(image);
  }

  /// Null, with a warning, where it cannot be read.
  sensor_msgs::ImageConstPtr unpacked(const sensor_msgs::CompressedImage& message) {
    try {
      return imageFromCompressed(message);
    } catch (const std::exception& error) {
      health().dropped(error.what());
      warn(std::string("frame skipped: ") + error.what());
      return nullptr;
    }
  }

  void onColor(const sensor_msgs::ImageConstPtr& color) { publish(partner_->addColor(color)); }

  void onDepth(const sensor_msgs::ImageConstPtr& depth) {
    publish(partner_->addDepth(depth, color_sub_.getNumPublishers() > 0));
  }

  void publish(const std::vector<ColorPartner::Pair>& images) {
    for (const auto& [depth, color] : images)
      attempt(depth->header.stamp,
              [&, &depth = depth, &color = color] { publish(*depth, color.get()); });
  }

  void publish(const sensor_msgs::Image& depth, const sensor_msgs::Image* color) {
    if (!info_)
      throw std::runtime_error("no CameraInfo on " + info_sub_.getTopic() +
                               " yet, without it depth is no cloud");
    if (!color && color_sub_.getNumPublishers() > 0)
      warn("no image on " + color_sub_.getTopic() + " within " + std::to_string(interval_) +
           " s of the depth image: its cloud has no colour");
    forgetWhatIsOld(depth.header.stamp);
    const auto packed_color = color ? packedView(*color) : PackedImage();
    cloud_pub_.publish(boost::make_shared<CloudMessage>(
        depth.header, cloudFromDepth(packedView(depth), color ? &packed_color : nullptr,
                                     projectionOf(*info_), options_, &memory_)));
  }

  /// The filter over time begins anew after a gap, and where time jumps back.
  void forgetWhatIsOld(const ros::Time& stamp) {
    const ros::Duration gap = stamp - last_stamp_;
    if (gap < ros::Duration(0) || gap > ros::Duration(MAX_GAP)) memory_ = {};
    last_stamp_ = stamp;
  }

  static constexpr double MAX_GAP = 0.5;  ///< between two frames [s]

  DepthImageOptions options_;
  bool compressed_ = false;  ///< what image_transport's plug-ins send is listened to
  double interval_ = 0.02;   ///< farthest that stamps of depth and colour differ [s]
  std::optional<ColorPartner> partner_;
  DepthMemory memory_;
  ros::Time last_stamp_;
  sensor_msgs::CameraInfoConstPtr info_;
  ros::Publisher cloud_pub_;
  ros::Subscriber info_sub_, color_sub_, depth_sub_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::DepthImageNodelet, nodelet::Nodelet)
