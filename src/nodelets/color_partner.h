#pragma once

#include <deque>
#include <utility>
#include <vector>

#include <ros/duration.h>
#include <sensor_msgs/Image.h>

namespace tabletop_perception {

/// Finds the colour image of every depth image. Unlike message_filters' ApproximateTime it does not
/// wait for the next images to see whether they fit better, and a depth image that finds no partner
/// is given back all the same, alone.
class ColorPartner {
 public:
  /// Stamps of partners differ by at most `interval`.
  explicit ColorPartner(ros::Duration interval) : interval_(interval) {}

  using Pair = std::pair<sensor_msgs::ImageConstPtr, sensor_msgs::ImageConstPtr>;

  /// Takes the next depth or colour image; gives back the depth images whose wait is over, oldest
  /// first, each with its colour image or null. Without `wait` a depth image does not wait for
  /// colour images to come.
  std::vector<Pair> addDepth(const sensor_msgs::ImageConstPtr& depth, bool wait);
  std::vector<Pair> addColor(const sensor_msgs::ImageConstPtr& color);

 private:
  /// The nearest colour image within the interval, or null.
  sensor_msgs::ImageConstPtr partnerOf(const sensor_msgs::Image& depth) const;

  static constexpr std::size_t MAX_COLORS = 5;

  ros::Duration interval_;
  sensor_msgs::ImageConstPtr waiting_;  ///< depth, or null
  std::deque<sensor_msgs::ImageConstPtr> colors_;
};

}  // namespace tabletop_perception
