#include "color_partner.h"

namespace tabletop_perception {
namespace {

ros::Duration distance(const sensor_msgs::Image& a, const sensor_msgs::Image& b) {
  const ros::Duration difference = a.header.stamp - b.header.stamp;
  return difference < ros::Duration(0) ? -difference : difference;
}

}  // namespace

std::vector<ColorPartner::Pair> ColorPartner::addDepth(const sensor_msgs::ImageConstPtr& depth,
                                                       bool wait) {
  std::vector<Pair> done;
  if (waiting_) done.emplace_back(std::exchange(waiting_, nullptr), nullptr);
  const auto partner = partnerOf(*depth);
  if (partner || !wait)
    done.emplace_back(depth, partner);
  else
    waiting_ = depth;
  return done;
}

std::vector<ColorPartner::Pair> ColorPartner::addColor(const sensor_msgs::ImageConstPtr& color) {
  colors_.push_back(color);
  if (colors_.size() > MAX_COLORS) colors_.pop_front();
  if (!waiting_) return {};
  const auto partner = partnerOf(*waiting_);
  const bool too_late = color->header.stamp > waiting_->header.stamp;  // as all that follow
  if (!partner && !too_late) return {};
  return {{std::exchange(waiting_, nullptr), partner}};
}

sensor_msgs::ImageConstPtr ColorPartner::partnerOf(const sensor_msgs::Image& depth) const {
  sensor_msgs::ImageConstPtr nearest;
  for (const auto& color : colors_)
    if (distance(*color, depth) <= interval_ &&
        (!nearest || distance(*color, depth) < distance(*nearest, depth)))
      nearest = color;
  return nearest;
}

}  // namespace tabletop_perception
