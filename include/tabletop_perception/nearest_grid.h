#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/geometry.h"

namespace tabletop_perception {

/// Nearest points of a fixed surface by table look-up: a grid of cubes, each holding the index of
/// the surface point nearest to its centre. Exact to within the cube's half diagonal.
class NearestGrid {
 public:
  NearestGrid() = default;

  /// Covers everything within `margin` of the surface in cubes of `cell` [m].
  /// Throws std::invalid_argument for an empty surface.
  NearestGrid(const Surface& surface, double cell, double margin);

  /// Index of the surface point nearest to `p`, or -1 farther than the margin from its box.
  int nearest(const Eigen::Vector3f& p) const {
    const Eigen::Array3i c = ((p - origin_) * inverse_cell_).array().floor().cast<int>();
    if ((c < 0).any() || (c >= size_).any()) return -1;
    return cells_[(static_cast<std::size_t>(c.z()) * size_.y() + c.y()) * size_.x() + c.x()];
  }

 private:
  Eigen::Vector3f origin_ = Eigen::Vector3f::Zero();
  float inverse_cell_ = 0;
  Eigen::Array3i size_ = Eigen::Array3i::Zero();
  std::vector<std::int32_t> cells_;
};

}  // namespace tabletop_perception
