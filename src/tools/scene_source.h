#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/cloud.h"

namespace tabletop_perception::tools {

/// One cloud to work on, and what its file says about it.
struct Scene {
  std::string name;      ///< the file's stem, the folder's name, or bagstem_NNNNNN
  std::string frame_id;  ///< of the bag's message, else empty
  double stamp = 0;      ///< of the bag's message, else 0 [s]
  Cloud cloud;           ///< the sensor at the origin, the axes those of the file [m]
  /// Where the sensor is in the file's own frame [m]: a point p of `cloud` is p + sensor there.
  /// Zero but for a .pcd whose VIEWPOINT says otherwise.
  Eigen::Vector3d sensor = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> up;  ///< against gravity, unit length, where the file states it
};

/// Reads scenes one by one, in the order of `arguments`, and hands each to `visit`. An argument is
/// a .pcd, a .bag (every sensor_msgs/PointCloud2 of `topic`; with an empty `topic`, of the bag's
/// only topic with clouds), or a folder with depth.png (16 bit), perhaps color.png, and a gt.json
/// or camera.json whose `camera` {fx, fy, cx, cy, width, height} and `depth_unit_m` say how to
/// project; its `up`, three numbers, is optional. Throws std::invalid_argument with the file and
/// what is wrong with it: arguments that do not exist or are none of these before the first visit,
/// the rest when its turn comes.
void visitScenes(const std::vector<std::string>& arguments, const std::string& topic,
                 const std::function<void(const Scene&)>& visit);

}  // namespace tabletop_perception::tools
