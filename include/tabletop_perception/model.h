#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/descriptor.h"
#include "tabletop_perception/geometry.h"

namespace tabletop_perception {

/// Rotations that map a shape onto itself, about `center` in the object's frame.
struct Symmetry {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< [m]
  /// Unit axis of a continuous symmetry (a can), zero if there is none.
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  /// Discrete rotations besides the identity (a box has three half turns); with an axis: those
  /// that turn the axis over.
  std::vector<Eigen::Matrix3d> rotations;
  bool declared = false;  ///< stated by the user, not found in the shape

  bool continuous() const { return !axis.isZero(); }
};

/// An object as it looked from one place.
struct View {
  Eigen::Isometry3d T_view_object = Eigen::Isometry3d::Identity();  ///< object in the camera
  Surface surface;                      ///< what the camera saw, in the camera's frame [m]
  std::vector<Descriptor> descriptors;  ///< of `surface`, seen from the origin
};

/// A way to take hold of an object with a two-fingered gripper.
struct StoredGrasp {
  std::string name;  ///< no other of the object has it
  /// z the direction in which the gripper comes, y that in which it opens, the origin between the
  /// fingertips.
  Eigen::Isometry3d T_object_gripper = Eigen::Isometry3d::Identity();
  double width = 0;       ///< of the open gripper [m]
  double preference = 0;  ///< the grasp with the largest is tried first
};

/// Everything known about one object.
struct ObjectModel {
  std::string name;    ///< letters, digits, '_' and '-': it becomes part of a tf frame
  std::string origin;  ///< where it came from, for people ("mesh can.ply", "4 clouds")
  Surface surface;     ///< the whole known surface in the object's frame [m]
  std::vector<std::uint32_t> colors;  ///< 0x00RRGGBB per point of `surface`, or empty
  double diameter = 0;                ///< largest distance of two of its points [m]
  Symmetry symmetry;
  DescriptorOptions options;  ///< the views were described with
  std::vector<View> views;
  std::vector<StoredGrasp> grasps;
};

/// Throws std::invalid_argument unless `name` may name an object: 1 to 100 letters, digits, '_' and
/// '-', and not "unknown", which is what things without a name are called.
void checkObjectName(const std::string& name);

/// Throws std::invalid_argument, naming what is amiss, unless the grasp has a name as objects have,
/// a rotation, a width of 1 mm to 1 m, and only finite numbers.
void checkGrasp(const StoredGrasp& grasp);

/// Throws std::invalid_argument, naming what is amiss, unless the model is whole: a name, points,
/// a diameter, views with points, a unit normal for every point, no number that is not finite.
void checkModel(const ObjectModel& model);

}  // namespace tabletop_perception
