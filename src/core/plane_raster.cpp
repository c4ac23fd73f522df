#include "plane_raster.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int LANES = 16;  // points that a kernel takes at once

/// A camera's coordinates in a frame on a plane: rows of the transform.
struct ToPlane {
  float u[4], v[4], height[4];

  explicit ToPlane(const Eigen::Isometry3d& T_camera_plane) {
    const Eigen::Matrix4f T = T_camera_plane.inverse().matrix().cast<float>();
    for (int k = 0; k < 4; ++k) {
      u[k] = T(0, k);
      v[k] = T(1, k);
      height[k] = T(2, k);
    }
  }
};

inline float dot(const float* row, float x, float y, float z) {
  return row[0] * x + row[1] * y + row[2] * z + row[3];
}

/// Where the points near a plane lie on it.
struct Extent {
  float low_u = std::numeric_limits<float>::max(), high_u = -low_u;
  float low_v = low_u, high_v = -low_u;
};

TABLETOP_SIMD_CLONES
Extent extentOf(const float* x, const float* y, const float* z, std::size_t count,
                const ToPlane& to, float distance) {
  const Extent none;
  float low_u[LANES], high_u[LANES], low_v[LANES], high_v[LANES];
  for (int l = 0; l < LANES; ++l) {
    low_u[l] = low_v[l] = none.low_u;
    high_u[l] = high_v[l] = none.high_u;
  }
  const auto add = [&](std::size_t i, int l) {
    const bool near = std::abs(dot(to.height, x[i], y[i], z[i])) <= distance;
    const float u = nanUnless(near, dot(to.u, x[i], y[i], z[i]));  // NaN is less than nothing
    const float v = nanUnless(near, dot(to.v, x[i], y[i], z[i]));
    low_u[l] = u < low_u[l] ? u : low_u[l];
    high_u[l] = u > high_u[l] ? u : high_u[l];
    low_v[l] = v < low_v[l] ? v : low_v[l];
    high_v[l] = v > high_v[l] ? v : high_v[l];
  };
  std::size_t i = 0;
  for (; i + LANES <= count; i += LANES)
    for (int l = 0; l < LANES; ++l) add(i + l, l);
  for (; i < count; ++i) add(i, 0);
  return {*std::min_element(low_u, low_u + LANES), *std::max_element(high_u, high_u + LANES),
          *std::min_element(low_v, low_v + LANES), *std::max_element(high_v, high_v + LANES)};
}

/// The cells of all points. `low_u`, `low_v`: of the raster, its border included.
TABLETOP_SIMD_CLONES
void cellsOf(const float* x, const float* y, const float* z, std::size_t count, const ToPlane& to,
             float distance, float low_u, float low_v, float cells_per_metre, int columns,
             int* cell) {
  for (std::size_t i = 0; i < count; ++i) {
    const bool near = std::abs(dot(to.height, x[i], y[i], z[i])) <= distance;
    const float u = (dot(to.u, x[i], y[i], z[i]) - low_u) * cells_per_metre;
    const float v = (dot(to.v, x[i], y[i], z[i]) - low_v) * cells_per_metre;
    cell[i] =
        static_cast<int>(zeroUnless(near, v)) * columns + static_cast<int>(zeroUnless(near, u));
  }
}

}  // namespace

PlaneRaster rasterOver(const Cloud& cloud, const Eigen::Isometry3d& T_camera_plane, double distance,
                       double side, int max_cells) {
  PlaneRaster raster;
  raster.cell.resize(cloud.size());
  const ToPlane to(T_camera_plane);
  const auto limit = static_cast<float>(distance);
  const float *x = cloud.x.data(), *y = cloud.y.data(), *z = cloud.z.data();
  const Extent extent = extentOf(x, y, z, cloud.size(), to, limit);
  const float width = extent.high_u - extent.low_u, height = extent.high_v - extent.low_v;
  if (!(width >= 0)) return raster;

  const float cell = std::max(static_cast<float>(side), std::max(width, height) / max_cells);
  raster.columns = static_cast<int>(width / cell) + 3;
  raster.rows = static_cast<int>(height / cell) + 3;
  cellsOf(x, y, z, cloud.size(), to, limit, extent.low_u - cell, extent.low_v - cell, 1 / cell,
          raster.columns, raster.cell.data());
  return raster;
}

std::vector<int> pointsByCell(const PlaneRaster& raster, int share) {
  // Points side by side mostly share a cell: taken from far apart, none has to wait until the one
  // before is counted.
  constexpr std::size_t STREAMS = 8;
  std::vector<int> counts(static_cast<std::size_t>(raster.columns) * raster.rows, 0);
  const std::size_t length = raster.cell.size() / STREAMS;
  for (std::size_t i = 0; i < length; i += static_cast<std::size_t>(share))
    for (std::size_t s = 0; s < STREAMS; ++s) ++counts[raster.cell[s * length + i]];
  for (std::size_t i = STREAMS * length; i < raster.cell.size(); ++i) ++counts[raster.cell[i]];
  counts[0] = 0;
  return counts;
}

}  // namespace tabletop_perception
