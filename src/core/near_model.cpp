#include "near_model.h"

#include <algorithm>

namespace tabletop_perception {

Surface pointsNearModel(const ModelIndex& index, int model,
                        const Eigen::Isometry3d& T_camera_object,
                        const std::vector<Eigen::Vector3f>& points, double reach,
                        std::size_t count) {
  const auto& grid = index.grid(model);
  const auto& surface = index.models()[model].surface;
  const Eigen::Isometry3f T = T_camera_object.cast<float>();
  const Eigen::Isometry3f T_object_camera = T.inverse();
  Surface near;
  for (const auto& point : points) {
    const Eigen::Vector3f p = T_object_camera * point;
    const int nearest = grid.nearest(p);
    if (nearest < 0 || (surface.points[nearest] - p).norm() > reach) continue;
    near.points.push_back(point);
    near.normals.push_back(T.linear() * surface.normals[nearest]);
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
