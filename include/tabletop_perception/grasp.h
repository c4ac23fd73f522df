#pragma once

#include <Eigen/Geometry>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/options.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

struct GraspOptions {
  double approach = 0.1;  ///< distance of the pregrasp frame from what is to be grasped [m]
  double margin = 0.02;   ///< by which the gripper opens wider than the thing [m]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("approach", approach, Range{0.01, 1});
    visit("margin", margin, Range{0, 0.2});
  }
};

/// Where a two-fingered gripper waits: z the direction in which it comes, y that in which it opens.
struct Pregrasp {
  Eigen::Isometry3d T_camera_gripper = Eigen::Isometry3d::Identity();
  double width = 0;  ///< of the open gripper [m]
};

/// Where a gripper waits above a thing: z down along the table's normal, for it comes from the free
/// side; y along the shorter horizontal side of the thing's box; the origin `approach` above the
/// box. `box`: one of its axes along the table's normal.
Pregrasp pregraspAbove(const Box& box, const Table& table, const GraspOptions& options);

}  // namespace tabletop_perception
