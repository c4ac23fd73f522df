#include <pluginlib/class_list_macros.hpp>

#include "image_codec.h"
#include "stage_nodelet.h"

namespace tabletop_perception {

/// `~depth` Image -> `~depth/compressedDepth` CompressedImage, `~color` Image ->
/// `~color/compressed`: for a camera whose driver has not image_transport's plug-ins of these
/// names, and a link that is too slow for clouds.
class CompressNodelet : public StageNodelet {
  void start() override {
    refuseOtherParameters();
    const auto& nh = getPrivateNodeHandle();
    depth_pub_ =
        advertise<sensor_msgs::CompressedImage>(nh.resolveName("depth") + "/compressedDepth");
    color_pub_ = advertise<sensor_msgs::CompressedImage>(nh.resolveName("color") + "/compressed");
  }

  void subscribe() override {
    auto& nh = getPrivateNodeHandle();
    depth_sub_ = nh.subscribe("depth", 1, &CompressNodelet::onDepth, this);
    color_sub_ = nh.subscribe("color", 1, &CompressNodelet::onColor, this);
  }

  void unsubscribe() override {
    depth_sub_.shutdown();
    color_sub_.shutdown();
  }

  void onDepth(const sensor_msgs::ImageConstPtr& depth) {
    if (depth_pub_.getNumSubscribers() == 0) return;
    attempt(depth->header.stamp, [&] { depth_pub_.publish(compressedDepth(*depth)); });
  }

  void onColor(const sensor_msgs::ImageConstPtr& color) {
    if (color_pub_.getNumSubscribers() == 0) return;
    attempt(color->header.stamp, [&] { color_pub_.publish(compressedColor(*color)); });
  }

  ros::Publisher depth_pub_, color_pub_;
  ros::Subscriber depth_sub_, color_sub_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::CompressNodelet, nodelet::Nodelet)
