#include "near_model.h"

#include <algorithm>
#include <limits>

namespace tabletop_perception {

float squaredDistance(const ModelIndex& index, int model, const Eigen::Isometry3f& T_object_camera,
                      const Eigen::Vector3f& point) {
  const Eigen::Vector3f p = T_object_camera * point;
  const int nearest = index.grid(model).nearest(p);
  return nearest < 0 ? std::numeric_limits<float>::infinity()
                     : (index.models()[model].surface.points[nearest] - p).squaredNorm();
}

Surface pointsNearModel(const ModelIndex& index, int model,
                        const Eigen::Isometry3d& T_camera_object,
                        const std::vector<Eigen::Vector3f>& points, double reach,
                        std::size_t count) {
  constexpr std::size_t SIZE = PlanarBlock::SIZE;
  const auto& grid = index.grid(model);
  const Eigen::Isometry3f T = T_camera_object.cast<float>();
  const Eigen::Isometry3f T_object_camera = T.inverse();
  const auto max_squared = static_cast<float>(reach * reach);
  Surface near;
  PlanarBlock block{};  // normals of zero: which way points face does not count
  Correspondences nearest;
  for (std::size_t first = 0; first < points.size(); first += SIZE) {
    const std::size_t size = std::min(SIZE, points.size() - first);
    for (std::size_t i = 0; i < size; ++i) {
      block.x[i] = points[first + i].x();
      block.y[i] = points[first + i].y();
      block.z[i] = points[first + i].z();
    }
    grid.correspond(block, T_object_camera, max_squared, nearest, 0);
    for (std::size_t i = 0; i < size; ++i) {
      if (!(nearest.squared[i] <= max_squared)) continue;
      near.points.push_back(points[first + i]);
      near.normals.push_back(T.linear() *
                             Eigen::Vector3f(nearest.nx[i], nearest.ny[i], nearest.nz[i]));
    }
  }
  return thinned(near, count);
}

Surface thinned(const Surface& surface, std::size_t count) {
  const std::size_t step = std::max<std::size_t>(1, (surface.size() + count - 1) / count);
  Surface few;
  for (std::size_t i = 0; i < surface.size(); i += step) {
    few.points.push_back(surface.points[i]);
    few.normals.push_back(surface.normals[i]);
  }
  return few;
}

}  // namespace tabletop_perception
