#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tabletop_perception {

/// Points of a surface with their unit normals, in no order: a sampled cluster, a view, a model.
struct Surface {
  std::vector<Eigen::Vector3f> points;   ///< [m]
  std::vector<Eigen::Vector3f> normals;  ///< unit length, out of the surface; as many as points

  std::size_t size() const { return points.size(); }
  bool empty() const { return points.empty(); }
};

/// The surface moved by T_target_source.
Surface transformed(const Surface& source, const Eigen::Isometry3d& T_target_source);

/// Some points of a surface, in the order of the indices.
Surface selected(const Surface& surface, const std::vector<int>& indices);

/// Mean of the points; they must not be empty.
Eigen::Vector3f centroidOf(const std::vector<Eigen::Vector3f>& points);

/// The direction that a surface faces on the whole [unit]; z where its normals cancel out.
Eigen::Vector3f meanNormal(const Surface& surface);

/// A lower bound of the largest distance of two points, exact for most shapes; 0 for none [m].
double extentOf(const std::vector<Eigen::Vector3f>& points);

/// One point per cube of `leaf` [m] and direction that a surface in it faces (the two sides of a
/// thin wall stay apart): the mean point and the normalised mean normal.
/// Throws std::invalid_argument unless `leaf` is positive. Order: by first point in each cube.
Surface downsampled(const Surface& surface, double leaf);

/// A box about some points.
struct Box {
  Eigen::Isometry3d T_camera_box = Eigen::Isometry3d::Identity();  ///< its centre and axes
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  ///< sides along x, y, z, descending [m]
};

/// The box of the points' extents along their principal axes (z completes a right-handed frame);
/// with `up`, one axis is `up`, the others the sides of the least rectangle in the plane across it.
/// Of no points: an empty box.
Box boxAround(const std::vector<Eigen::Vector3f>& points, const std::optional<Eigen::Vector3d>& up);

/// The rotation by the smallest angle that turns direction `from` into direction `to` [unit].
Eigen::Matrix3d rotationBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// The angle of a rotation [rad], 0 to pi.
double angleOf(const Eigen::Matrix3d& rotation);

}  // namespace tabletop_perception
