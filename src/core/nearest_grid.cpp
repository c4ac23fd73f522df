#include "tabletop_perception/nearest_grid.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "tabletop_perception/kd_tree.h"

namespace tabletop_perception {

NearestGrid::NearestGrid(const Surface& surface, double cell, double margin) {
  if (surface.empty()) throw std::invalid_argument("nearest grid: the surface has no points");
  Eigen::Vector3f low = surface.points.front(), high = low;
  for (const auto& p : surface.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const auto wide = static_cast<float>(margin);
  origin_ = low.array() - wide;
  inverse_cell_ = static_cast<float>(1.0 / cell);
  size_ = ((high - origin_).array() + wide)
              .cwiseProduct(Eigen::Array3f::Constant(inverse_cell_))
              .ceil()
              .cast<int>()
              .max(1);

  const KdTree tree(surface.points);
  cells_.resize(static_cast<std::size_t>(size_.x()) * size_.y() * size_.z());
  std::size_t i = 0;
  for (int z = 0; z < size_.z(); ++z)
    for (int y = 0; y < size_.y(); ++y)
      for (int x = 0; x < size_.x(); ++x) {
        const Eigen::Vector3f offset = Eigen::Vector3f(x, y, z).array() + 0.5f;
        const Eigen::Vector3f center = origin_ + offset / inverse_cell_;
        cells_[i++] = tree.nearest(center).index;
      }
}

}  // namespace tabletop_perception
