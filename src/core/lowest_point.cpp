#include "lowest_point.h"

#include <algorithm>
#include <limits>

namespace tabletop_perception {

double lowestAbove(const Table& table, const Eigen::Isometry3d& T_camera_object,
                   const std::vector<Eigen::Vector3f>& points) {
  const Eigen::Vector3d up = table.plane.head<3>();
  const Eigen::Vector3f up_of_object = (T_camera_object.linear().transpose() * up).cast<float>();
  float lowest = std::numeric_limits<float>::infinity();
  for (const auto& p : points) lowest = std::min(lowest, up_of_object.dot(p));
  return lowest + up.dot(T_camera_object.translation()) + table.plane[3];
}

double sinkOf(const Table& table, const Eigen::Isometry3d& T_camera_object,
              const std::vector<Eigen::Vector3f>& points) {
  return std::max(0.0, -lowestAbove(table, T_camera_object, points));
}

}  // namespace tabletop_perception
