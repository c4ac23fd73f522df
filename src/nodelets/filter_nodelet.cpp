#include <algorithm>
#include <chrono>
#include <vector>

#include <boost/make_shared.hpp>
#include <boost/weak_ptr.hpp>
#include <pluginlib/class_list_macros.hpp>

#include "cloud_message.h"
#include "conversions.h"
#include "stage_nodelet.h"
#include "tabletop_perception/FilterConfig.h"
#include "tabletop_perception/filter.h"

namespace tabletop_perception {

/// `~input` PointCloud2 of the camera -> `~cloud` PointCloud2, cropped and without outliers.
///
/// The graph's entrance: a frame that comes while the stages behind are busy with two others is
/// dropped here, whole. That a stage of this manager is still busy with a frame shows in its
/// message: it is passed on by pointer, and the last one to let go of it is done.
class FilterNodelet : public StageNodelet {
  void start() override {
    serveOptions<FilterConfig>(getPrivateNodeHandle(), options_);
    cloud_pub_ = advertise<CloudMessage>("cloud");
  }

  void subscribe() override {
    input_sub_ = getPrivateNodeHandle().subscribe("input", 1, &FilterNodelet::onCloud, this);
  }

  void unsubscribe() override { input_sub_.shutdown(); }

  void onCloud(const sensor_msgs::PointCloud2ConstPtr& message) {
    if (busy()) return;
    attempt([&] {
      const auto filtered = boost::make_shared<CloudMessage>(
          message->header, filterCloud(packedView(*message), options_));
      frames_.push_back({filtered, Clock::now()});
      cloud_pub_.publish(filtered);
    });
  }

  bool busy() {
    const auto done = [](const Frame& frame) {
      return frame.cloud.expired() || Clock::now() - frame.start > GIVE_UP;
    };
    frames_.erase(std::remove_if(frames_.begin(), frames_.end(), done), frames_.end());
    return frames_.size() >= MAX_FRAMES;
  }

  using Clock = std::chrono::steady_clock;
  struct Frame {
    boost::weak_ptr<const CloudMessage> cloud;
    Clock::time_point start;
  };
  static constexpr std::size_t MAX_FRAMES = 2;       ///< one is refined while the next is matched
  static constexpr std::chrono::seconds GIVE_UP{2};  ///< somebody keeps the cloud for good

  FilterOptions options_;
  std::vector<Frame> frames_;  ///< in the graph
  ros::Publisher cloud_pub_;
  ros::Subscriber input_sub_;
};

}  // namespace tabletop_perception

PLUGINLIB_EXPORT_CLASS(tabletop_perception::FilterNodelet, nodelet::Nodelet)
