#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/planar_surface.h"

namespace tabletop_perception {

/// A block of points in the frame of a surface, beside the surface's points nearest to them.
struct Correspondences {
  static constexpr int SIZE = PlanarBlock::SIZE;
  alignas(32) float x[SIZE], y[SIZE], z[SIZE];  ///< the points [m]
  float dx[SIZE], dy[SIZE], dz[SIZE];           ///< from there to the nearest [m]
  float nx[SIZE], ny[SIZE], nz[SIZE];           ///< its normal
  float squared[SIZE];  ///< their distance [m^2]; infinite where there is no correspondence
};

/// Nearest points of a fixed surface by table look-up: a grid of cubes, each holding the index of
/// the surface point nearest to its centre. Exact to within the cube's half diagonal.
class NearestGrid {
 public:
  NearestGrid() = default;

  /// Covers everything within `margin` of the surface in cubes of `cell` [m], of larger ones where
  /// these would be more than four million.
  /// Throws std::invalid_argument for an empty surface.
  NearestGrid(const Surface& surface, double cell, double margin);

  /// Index of the surface point nearest to `p`, or -1 farther than the margin from its box.
  int nearest(const Eigen::Vector3f& p) const {
    const Eigen::Array3f at = (p - origin_) * inverse_cell_;
    if (!((at >= 0).all() && (at < size_.cast<float>()).all())) return -1;  // nor where it is NaN
    const Eigen::Array3i c = at.cast<int>();
    return indexAt((c.z() * size_.y() + c.y()) * size_.x() + c.x());
  }

  /// Moves a block of points into the surface's frame and finds the nearest of each. None farther
  /// than the root of `max_squared` [m^2], and none where the normals disagree: the cosine of their
  /// angle, either way round, is below `min_normal_dot`. The nearest point of a thin wall may lie
  /// on its other side.
  void correspond(const PlanarBlock& points, const Eigen::Isometry3f& T_surface_points,
                  float max_squared, Correspondences& out, float min_normal_dot = 0.5f) const;

  /// Bytes that it occupies.
  std::size_t memory() const;

 private:
  /// A point and its normal, side by side in one cache line: two registers of four.
  struct alignas(32) Facet {
    float x, y, z, nx, ny, nz, unused[2];
  };

  int indexAt(std::size_t cell) const {
    return wide_cells_.empty() ? cells_[cell] : static_cast<int>(wide_cells_[cell]);
  }

  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
  float inverse_cell_ = 0;
  Eigen::Array3i size_ = Eigen::Array3i::Zero();
  std::vector<Facet> facets_;
  std::vector<std::uint16_t> cells_;       // half the memory, and of the cache
  std::vector<std::uint32_t> wide_cells_;  // instead, for a surface of more points than they count
};

}  // namespace tabletop_perception
