#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/model.h"
#include "tabletop_perception/options.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

/// How to grasp, and with what: a gripper with a palm and two fingers, all of them boxes. In its
/// frame z is the direction in which it comes, y that in which it opens; the origin lies between
/// the fingertips, so that all of it is at z of 0 and less.
struct GraspOptions {
  double approach = 0.1;         ///< distance of the pregrasp frame from what is to be grasped [m]
  double margin = 0.02;          ///< by which the gripper opens wider than the thing [m]
  double clearance = 0.002;      ///< that a stored grasp has to leave above the table [m]
  double finger_length = 0.05;   ///< along z, from the palm to the fingertips [m]
  double finger_breadth = 0.02;  ///< along x [m]
  double finger_thickness = 0.01;  ///< along y, outwards from the opening [m]
  double palm_length = 0.1;        ///< along z, behind the fingers [m]
  double palm_breadth = 0.06;      ///< along x [m]
  double palm_width = 0.15;        ///< along y, however far the gripper is open [m]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("approach", approach, Range{0.01, 1});
    visit("margin", margin, Range{0, 0.2});
    visit("clearance", clearance, Range{0, 0.1});
    visit("finger_length", finger_length, Range{0.005, 0.5});
    visit("finger_breadth", finger_breadth, Range{0.001, 0.5});
    visit("finger_thickness", finger_thickness, Range{0.001, 0.2});
    visit("palm_length", palm_length, Range{0.001, 1});
    visit("palm_breadth", palm_breadth, Range{0.001, 1});
    visit("palm_width", palm_width, Range{0.001, 1});
  }
};

/// Where a two-fingered gripper waits.
struct Pregrasp {
  Eigen::Isometry3d T_camera_gripper = Eigen::Isometry3d::Identity();
  double width = 0;  ///< of the open gripper [m]
};

/// Where a gripper waits above a thing: z down along the table's normal, for it comes from the free
/// side; y along the shorter horizontal side of the thing's box; the origin `approach` above the
/// box. `box`: one of its axes along the table's normal.
Pregrasp pregraspAbove(const Box& box, const Table& table, const GraspOptions& options);

/// A stored grasp of an object at its pose.
struct PlacedGrasp {
  StoredGrasp grasp;
  Eigen::Isometry3d T_camera_gripper = Eigen::Isometry3d::Identity();   ///< where it closes
  Eigen::Isometry3d T_camera_pregrasp = Eigen::Isometry3d::Identity();  ///< `approach` before
  std::string reason;  ///< why it cannot be used, with figures; empty if it can
};

/// The grasps of an object, the preferred ones first, of equal ones by name. Those on whose way,
/// straight from the pregrasp, any part of the gripper would come nearer to the table's plane than
/// `clearance`, within its outline or not, have a reason. `table`: under the object.
std::vector<PlacedGrasp> placedGrasps(const std::vector<StoredGrasp>& grasps,
                                      const Eigen::Isometry3d& T_camera_object, const Table& table,
                                      const GraspOptions& options);

}  // namespace tabletop_perception
