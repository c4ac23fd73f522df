#include <algorithm>
#include <chrono>
#include <vector>

#include <boost/make_shared.hpp>
#include <boost/weak_ptr.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "message_pool.h"
#include "stage_nodelet.h"
#include "tabletop_perception/FilterConfig.h"
#include "tabletop_perception/filter.h"

namespace tabletop_perception {

/// `~input` PointCloud2 of the camera -> `~cloud` PointCloud2, cropped and without outliers.
///
/// roscpp hands on by pointer what is published and subscribed to as one type: with `unpacked` that
/// is the type of this package's nodelets, else everybody's sensor_msgs/PointCloud2.
///
/// The graph's entrance: a frame that comes while the stages behind are busy with two others is
/// dropped here, whole. That a stage of this manager is still busy with a frame shows in its
/// message: it is passed on by pointer, and the last one to let go of it is done.
class FilterNodelet : public StageNodelet {
  void start() override {
    unpacked_ = parameter("unpacked", unpacked_);
    serveOptions<FilterConfig>(getPrivateNodeHandle(), options_);
    cloud_pub_ = advertise<CloudMessage>("cloud");
  }

  void subscribe() override {
    auto& nh = getPrivateNodeHandle();
    if (unpacked_) {
      input_sub_ = nh.subscribe("input", 1, &FilterNodelet::onUnpacked, this);
      return;
    }
    ros::SubscribeOptions options;
    options.initByFullCallbackType<const sensor_msgs::PointCloud2ConstPtr&>(
        "input", 1, [this](const auto& message) { onPacked(message); }, pool_);
    input_sub_ = nh.subscribe(options);
  }

  void unsubscribe() override { input_sub_.shutdown(); }

  void onUnpacked(const CloudMessageConstPtr& message) {
    onCloud(message->header, [&] { return filterCloud(message->cloud(), options_); });
  }

  void onPacked(const sensor_msgs::PointCloud2ConstPtr& message) {
    onCloud(message->header, [&] { return filterCloud(packedView(*message), options_); });
  }

  template <typename Filter>
  void onCloud(const std_msgs::Header& header, Filter filtered) {
    if (busy()) {
      health().dropped("two frames are in the graph");
      return;
    }
    attempt(header.stamp, [&] {
      const auto cloud = boost::make_shared<CloudMessage>(header, filtered());
      frames_.push_back({cloud, Clock::now()});
      cloud_pub_.publish(cloud);
    });
  }

  /// Frames leave the graph in the order in which they came: those before one that is done are,
  /// too, even if somebody keeps them.
  bool busy() {
    const auto done = [](const Frame& frame) {
      return frame.cloud.expired() || Clock::now() - frame.start > GIVE_UP;
    };
    const auto last_done = std::find_if(frames_.rbegin(), frames_.rend(), done);
    frames_.erase(frames_.begin(), last_done.base());
    return frames_.size() >= MAX_FRAMES;
  }

  using Clock = std::chrono::steady_clock;
  struct Frame {
    boost::weak_ptr<const CloudMessage> cloud;
    Clock::time_point start;
  };
  static constexpr std::size_t MAX_FRAMES = 2;        ///< one is refined while the next is matched
  static constexpr std::chrono::seconds GIVE_UP{10};  ///< somebody keeps all clouds

  bool unpacked_ = false;  ///< the input comes from a nodelet of this package
  FilterOptions options_;
  std::vector<Frame> frames_;  ///< in the graph
  MessagePool<sensor_msgs::PointCloud2> pool_;
  ros::Publisher cloud_pub_;
  ros::Subscriber input_sub_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::FilterNodelet, nodelet::Nodelet)
