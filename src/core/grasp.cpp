#include "tabletop_perception/grasp.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "format.h"

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

namespace {

struct GripperPart {
  const char* name;
  Eigen::AlignedBox3d box;  ///< in the gripper's frame [m]
};

/// Of a gripper that is open by `width` [m].
std::array<GripperPart, 3> partsOf(const GraspOptions& o, double width) {
  const auto box = [](double x, double y_from, double y_to, double z_from, double z_to) {
    return Eigen::AlignedBox3d(Eigen::Vector3d(-x / 2, y_from, z_from),
                               Eigen::Vector3d(x / 2, y_to, z_to));
  };
  const double inner = width / 2, outer = inner + o.finger_thickness;
  const double palm = std::max(o.palm_width / 2, outer);
  return {{{"a finger", box(o.finger_breadth, inner, outer, -o.finger_length, 0)},
           {"a finger", box(o.finger_breadth, -outer, -inner, -o.finger_length, 0)},
           {"the palm",
            box(o.palm_breadth, -palm, palm, -o.finger_length - o.palm_length, -o.finger_length)}}};
}

/// Height above a table of the lowest corner of a box [m].
double lowestCorner(const Eigen::AlignedBox3d& box, const Eigen::Isometry3d& T_camera_gripper,
                    const Table& table) {
  double lowest = std::numeric_limits<double>::infinity();
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d p =
        T_camera_gripper * box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
    lowest = std::min(lowest, table.plane.head<3>().dot(p) + table.plane[3]);
  }
  return lowest;
}

/// Why a gripper cannot go from one pose straight to another of the same orientation: heights above
/// a plane are least at the ends. Empty if it can.
std::string wayRefusal(const PlacedGrasp& placed, const Table& table, const GraspOptions& options) {
  for (const bool before : {false, true})
    for (const auto& part : partsOf(options, placed.grasp.width)) {
      const double height = lowestCorner(
          part.box, before ? placed.T_camera_pregrasp : placed.T_camera_gripper, table);
      if (height >= options.clearance) continue;
      return format("%s would be %.3f m %s the table%s, clearance %.3f", part.name,
                    std::abs(height), height < 0 ? "below" : "above",
                    before ? " at the pregrasp" : "", options.clearance);
    }
  return "";
}

}  // namespace

std::vector<PlacedGrasp> placedGrasps(const std::vector<StoredGrasp>& grasps,
                                      const Eigen::Isometry3d& T_camera_object, const Table& table,
                                      const GraspOptions& options) {
  checkOptions("grasp", options);
  std::vector<PlacedGrasp> placed;
  for (const auto& grasp : grasps) {
    PlacedGrasp one;
    one.grasp = grasp;
    one.T_camera_gripper = T_camera_object * grasp.T_object_gripper;
    one.T_camera_pregrasp = one.T_camera_gripper * Eigen::Translation3d(0, 0, -options.approach);
    one.reason = wayRefusal(one, table, options);
    placed.push_back(std::move(one));
  }
  std::sort(placed.begin(), placed.end(), [](const PlacedGrasp& a, const PlacedGrasp& b) {
    return a.grasp.preference != b.grasp.preference ? a.grasp.preference > b.grasp.preference
                                                    : a.grasp.name < b.grasp.name;
  });
  return placed;
}

}  // namespace tabletop_perception
