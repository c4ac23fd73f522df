#include "stock_cloud.h"

#include <cmath>

#include <pcl/console/print.h>
#include <pcl/conversions.h>

namespace tabletop_perception::tools::stock {

Points::Ptr pointsOf(const Cloud& cloud) {
  const Points::Ptr points(new Points(cloud.width, cloud.height));
  points->is_dense = true;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    auto& point = (*points)[i];
    point.getVector3fMap() = cloud.point(i);
    point.rgba = cloud.colored() ? cloud.rgb[i] : 0;
    points->is_dense = points->is_dense && cloud.valid(i);
  }
  return points;
}

pcl::PCLPointCloud2 packedMessage(const Cloud& cloud) {
  pcl::PCLPointCloud2 message;
  pcl::toPCLPointCloud2(*pointsOf(cloud), message);
  return message;
}

void silence() { pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS); }

Forward forwardOf(const Cloud& cloud) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int i : validIndices(cloud)) sum += cloud.point(i).cast<double>();
  int axis = 2;
  for (const int other : {0, 1})
    if (std::abs(sum[other]) > std::abs(sum[axis])) axis = other;
  return {std::string(1, "xyz"[axis]), sum[axis] >= 0};
}

}  // namespace tabletop_perception::tools::stock
