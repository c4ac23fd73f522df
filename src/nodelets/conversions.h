#pragma once

#include <sensor_msgs/PointCloud2.h>

#include "tabletop_perception/cloud.h"

namespace tabletop_perception {

/// The points of a message. Throws std::invalid_argument when its fields and sizes do not add up
/// (see unpackCloud).
Cloud cloudFromMessage(const sensor_msgs::PointCloud2& message);

}  // namespace tabletop_perception
