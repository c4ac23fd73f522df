#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"

namespace tabletop_perception {

/// A raster laid over a plane, and the cell of each point near it.
struct PlaneRaster {
  int columns = 1,
      rows = 1;           ///< with a border of one cell around all points; without any: one cell
  std::vector<int> cell;  ///< by point: row x columns + column; 0, a cell of the border: not near
};

/// Points count as near within `distance` [m]. Cells have sides of `side` [m], or larger ones where
/// it takes more than `max_cells` of them to go from one end to the other.
PlaneRaster rasterOver(const Cloud& cloud, const Eigen::Isometry3d& T_camera_plane, double distance,
                       double side, int max_cells);

/// How many of every `share`-th point lie in each cell; none in cell 0.
std::vector<int> pointsByCell(const PlaneRaster& raster, int share);

}  // namespace tabletop_perception
