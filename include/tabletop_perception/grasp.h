#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/options.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

/// A place of a two-fingered gripper between its fingertips: z the direction in which it comes,
/// y that in which it opens.
struct Grasp {
  Eigen::Isometry3d T_object_gripper = Eigen::Isometry3d::Identity();  ///< at the object [m]
  double width = 0;                                                    ///< of the open gripper [m]
};

/// Throws std::invalid_argument unless the pose is a rigid motion of finite numbers and the width
/// lies between 0 and 1 m.
void checkGrasp(const Grasp& grasp);

struct GraspOptions {
  double approach = 0.1;    ///< distance of the pregrasp frame from what is to be grasped [m]
  double margin = 0.02;     ///< by which the gripper opens wider than the thing [m]
  double clearance = 0.01;  ///< least height of fingertips and wrist above the table [m]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("approach", approach, Range{0.01, 1});
    visit("margin", margin, Range{0, 0.2});
    visit("clearance", clearance, Range{0, 0.2});
  }
};

/// The same place in the camera's frame.
struct PlacedGrasp {
  Eigen::Isometry3d T_camera_gripper = Eigen::Isometry3d::Identity();
  double width = 0;  ///< of the open gripper [m]
};

/// Where a gripper waits above a thing: z down along the table's normal, for it comes from the free
/// side; y along the shorter horizontal side of the thing's box; the origin `approach` above the
/// box. `box`: one of its axes along the table's normal.
PlacedGrasp pregraspAbove(const Box& box, const Table& table, const GraspOptions& options);

/// Of an object's grasps those that a gripper can reach without going through the table, in their
/// order: both fingertips, and the wrist at the beginning of the approach, stay `clearance` above
/// it.
std::vector<PlacedGrasp> graspsAboveTable(const std::vector<Grasp>& grasps,
                                          const Eigen::Isometry3d& T_camera_object,
                                          const Table& table, const GraspOptions& options);

}  // namespace tabletop_perception
