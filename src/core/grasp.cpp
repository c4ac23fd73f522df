#include "tabletop_perception/grasp.h"

namespace tabletop_perception {

Pregrasp pregraspAbove(const Box& box, const Table& table, const GraspOptions& options) {
  checkOptions("grasp", options);
  const Eigen::Vector3d up = table.plane.head<3>();
  const Eigen::Matrix3d& axes = box.T_camera_box.linear();
  Eigen::Index upright;
  (axes.transpose() * up).cwiseAbs().maxCoeff(&upright);
  const Eigen::Index a = (upright + 1) % 3, b = (upright + 2) % 3;
  const Eigen::Index shorter = box.size[a] <= box.size[b] ? a : b;

  Pregrasp pregrasp;
  pregrasp.width = box.size[shorter] + options.margin;
  const Eigen::Vector3d z = -up, y = axes.col(shorter);
  pregrasp.T_camera_gripper.linear() << y.cross(z), y, z;
  pregrasp.T_camera_gripper.translation() =
      box.T_camera_box.translation() + (box.size[upright] / 2 + options.approach) * up;
  return pregrasp;
}

}  // namespace tabletop_perception
