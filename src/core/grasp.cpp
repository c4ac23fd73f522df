#include "tabletop_perception/grasp.h"

#include <cmath>
#include <stdexcept>
#include <string>

namespace tabletop_perception {

void checkGrasp(const Grasp& grasp) {
  constexpr double MAX_WIDTH = 1;     // [m]
  constexpr double TOLERANCE = 1e-4;  // of R R^T against the identity
  const Eigen::Matrix3d& rotation = grasp.T_object_gripper.linear();
  if (!grasp.T_object_gripper.matrix().allFinite() ||
      !(rotation * rotation.transpose()).isIdentity(TOLERANCE) || rotation.determinant() < 0)
    throw std::invalid_argument("grasp must have finite numbers and a rotation");
  if (!(grasp.width > 0 && grasp.width <= MAX_WIDTH))
    throw std::invalid_argument("width of a grasp must be above 0 and at most 1 m, got " +
                                std::to_string(grasp.width));
}

PlacedGrasp pregraspAbove(const Box& box, const Table& table, const GraspOptions& options) {
  checkOptions("grasp", options);
  const Eigen::Vector3d up = table.plane.head<3>();
  const Eigen::Matrix3d& axes = box.T_camera_box.linear();
  Eigen::Index upright;
  (axes.transpose() * up).cwiseAbs().maxCoeff(&upright);
  const Eigen::Index a = (upright + 1) % 3, b = (upright + 2) % 3;
  const Eigen::Index shorter = box.size[a] <= box.size[b] ? a : b;

  PlacedGrasp pregrasp;
  pregrasp.width = box.size[shorter] + options.margin;
  const Eigen::Vector3d z = -up, y = axes.col(shorter);
  pregrasp.T_camera_gripper.linear() << y.cross(z), y, z;
  pregrasp.T_camera_gripper.translation() =
      box.T_camera_box.translation() + (box.size[upright] / 2 + options.approach) * up;
  return pregrasp;
}

std::vector<PlacedGrasp> graspsAboveTable(const std::vector<Grasp>& grasps,
                                          const Eigen::Isometry3d& T_camera_object,
                                          const Table& table, const GraspOptions& options) {
  checkOptions("grasp", options);
  const auto isClear = [&](const Eigen::Vector3d& point) {
    return heightAbove(table, point.cast<float>()) >= options.clearance;
  };
  std::vector<PlacedGrasp> above;
  for (const auto& grasp : grasps) {
    const Eigen::Isometry3d T_camera_gripper = T_camera_object * grasp.T_object_gripper;
    const Eigen::Vector3d finger(0, grasp.width / 2, 0), wrist(0, 0, -options.approach);
    if (isClear(T_camera_gripper * finger) && isClear(T_camera_gripper * -finger) &&
        isClear(T_camera_gripper * wrist))
      above.push_back({T_camera_gripper, grasp.width});
  }
  return above;
}

}  // namespace tabletop_perception
