#pragma once

#include <string>

#include <pcl/PCLPointCloud2.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "tabletop_perception/cloud.h"

/// Clouds in PCL's types, for what `tabletop benchmark` compares with.
namespace tabletop_perception::tools::stock {

using Points = pcl::PointCloud<pcl::PointXYZRGB>;

/// A cloud as a camera driver publishes it: 32 bytes a point, those of PointXYZRGB.
pcl::PCLPointCloud2 packedMessage(const Cloud& cloud);

/// The same points in PCL's type.
Points::Ptr pointsOf(const Cloud& cloud);

/// The axis of a cloud's frame along which the camera looks: "z" in an optical frame.
struct Forward {
  std::string axis;
  bool positive;  ///< in the axis's own direction
};
Forward forwardOf(const Cloud& cloud);

/// Keeps PCL from complaining on stderr, for which it takes time.
void silence();

}  // namespace tabletop_perception::tools::stock
