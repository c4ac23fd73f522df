#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"

namespace tabletop_perception {

/// Points of one row of a cloud, by index, from the first up to and with the last.
struct Stretch {
  int first, last;
};

/// A raster laid over the points near a plane, with a border of one empty cell. Cells are numbered
/// row x columns + column; cell 0, in the border, stands for all points that are not near.
class PlaneRaster {
 public:
  /// Points count as near within `distance` [m]. Cells have sides of `side` [m], or larger ones
  /// where it takes more than `max_cells` of them to go from one end to the other. The cloud has to
  /// outlive the raster.
  PlaneRaster(const Cloud& cloud, const Eigen::Isometry3d& T_camera_plane, double distance,
              double side, int max_cells);

  int columns() const { return columns_; }
  int rows() const { return rows_; }

  /// From the first to the last near point in each row of an organised cloud, rows without any left
  /// out; of an unorganised cloud each near point by itself. A row of pixels is a line on the
  /// plane: no other point lies farther out by more than its height above the plane makes it.
  const std::vector<Stretch>& nearStretches() const { return stretches_; }

  int cellOf(std::size_t point) const;

  /// How many of a share of the points (of all, if they are not many) lie in each cell; none in
  /// cell 0.
  std::vector<int> pointsByCell() const;

 private:
  /// The camera's coordinates in a frame on the plane: rows of the transform.
  struct ToPlane {
    float u[4], v[4], height[4];
  };

  void cellsOf(std::size_t first, std::size_t count, int* cells) const;
  void findStretches();
  void layOver(double side, int max_cells);

  const Cloud& cloud_;
  ToPlane to_plane_;
  float distance_;
  std::vector<Stretch> stretches_;
  float low_u_ = 0, low_v_ = 0, cells_per_metre_ = 0;  // low: of the raster, its border included
  int columns_ = 1, rows_ = 1;
};

}  // namespace tabletop_perception
