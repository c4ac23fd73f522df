#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/found.h"
#include "tabletop_perception/projection.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

/// x and y of points in a frame on a plane.
class Flattener {
 public:
  explicit Flattener(const Eigen::Isometry3d& T_camera_plane)
      : to_plane_((T_camera_plane.inverse().matrix().topRows<2>()).cast<float>()) {}

  Eigen::Vector2f operator()(const Cloud& cloud, std::size_t i) const {
    return to_plane_.leftCols<3>() * cloud.point(i) + to_plane_.col(3);
  }

 private:
  Eigen::Matrix<float, 2, 4> to_plane_;
};

/// The table on a plane that was found: fitted again to the points within `reach` [m] of it, first
/// to a sample, then to all, their patches outlined. `forward`: the camera's. Without a surface,
/// why there is none.
Found<Table> tableOnPlane(const Cloud& cloud, const Cloud& sample, const Eigen::Vector4d& plane,
                          double reach, const Eigen::Vector3d& forward,
                          const std::optional<Eigen::Vector3d>& up, const TableOptions& options);

/// A table's hull, grown by a decimetre where the edge of the picture cuts the table off: what
/// stands there may hide all of the table below it. Counter-clockwise, in the table's frame [m].
std::vector<Eigen::Vector2d> hullBeyondView(const Table& table, const Projection& projection);

}  // namespace tabletop_perception
