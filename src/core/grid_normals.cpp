#include "grid_normals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "plane_of_moments.h"
#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int LANES = LaneMoments::LANES;  // pixels that are taken at once
constexpr float NONE = std::numeric_limits<float>::quiet_NaN();

/// Every step-th pixel of a cloud with a border of pixels without a point, so that windows need no
/// limits: x, y, z and the distance from the sensor.
struct PaddedGrid {
  int columns, rows, border, width;  // width: of a padded row
  std::vector<float> x, y, z, range;

  PaddedGrid(const Cloud& cloud, int step, int half)
      : columns((cloud.width + step - 1) / step),
        rows((cloud.height + step - 1) / step),
        border(half),
        width((columns + LANES - 1) / LANES * LANES + 2 * half) {
    const std::vector<float> none(static_cast<std::size_t>(width) * (rows + 2 * half), NONE);
    x = y = z = range = none;
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns; ++column) {
        const std::size_t from = static_cast<std::size_t>(row) * step * cloud.width + column * step;
        const std::size_t to = at(row, column);
        x[to] = cloud.x[from];
        y[to] = cloud.y[from];
        z[to] = cloud.z[from];
        range[to] = std::sqrt(x[to] * x[to] + y[to] * y[to] + z[to] * z[to]);
      }
  }

  std::size_t at(int row, int column) const {
    return static_cast<std::size_t>(row + border) * width + column + border;
  }
  bool anyIn(std::size_t first) const {
    for (int l = 0; l < LANES; ++l)
      if (range[first + l] == range[first + l]) return true;
    return false;
  }
};

/// The sums over the windows of LANES pixels in a row, coordinates relative to the pixel, which
/// keeps single precision exact enough. A few pixels at a time: their ten sums stay in registers.
TABLETOP_SIMD_CLONES
void sumWindows(const float* x, const float* y, const float* z, const float* range,
                std::ptrdiff_t width, int half, float max_change, LaneMoments* out) {
  for (int first = 0; first < LANES; first += FLOATS) {
    Floats x0, y0, z0, range0;
    load(x + first, x0);
    load(y + first, y0);
    load(z + first, z0);
    load(range + first, range0);
    const Floats limit = max_change * range0;
    Floats n{}, sx{}, sy{}, sz{}, xx{}, xy{}, xz{}, yy{}, yz{}, zz{};
    for (int v = -half; v <= half; ++v)
      for (int u = -half; u <= half; ++u) {
        const std::ptrdiff_t at = first + v * width + u;
        Floats dx, dy, dz, change;
        load(x + at, dx);
        load(y + at, dy);
        load(z + at, dz);
        load(range + at, change);
        change -= range0;
        const auto near = (change <= limit) & (change >= -limit);  // not for NaN
        keepWhere(near, dx -= x0);
        keepWhere(near, dy -= y0);
        keepWhere(near, dz -= z0);
        n -= __builtin_convertvector(near, Floats);  // true is -1
        sx += dx;
        sy += dy;
        sz += dz;
        xx += dx * dx;
        xy += dx * dy;
        xz += dx * dz;
        yy += dy * dy;
        yz += dy * dz;
        zz += dz * dz;
      }
    store(n, out->n + first);
    store(sx, out->x + first);
    store(sy, out->y + first);
    store(sz, out->z + first);
    store(xx, out->xx + first);
    store(xy, out->xy + first);
    store(xz, out->xz + first);
    store(yy, out->yy + first);
    store(yz, out->yz + first);
    store(zz, out->zz + first);
  }
}

/// Gives the pixels between the computed ones the normal of the nearest of the four around them
/// that is on the same surface, as far as range tells.
void fillBetween(const Cloud& cloud, const PaddedGrid& grid, const Eigen::Vector3f& viewpoint,
                 int step, float max_change, Normals& normals) {
  for (int v = 0; v < cloud.height; ++v)
    for (int u = 0; u < cloud.width; ++u) {
      const std::size_t i = static_cast<std::size_t>(v) * cloud.width + u;
      if (!cloud.valid(i) || (v % step == 0 && u % step == 0)) continue;
      const Eigen::Vector3f p = cloud.point(i);
      const float range = p.norm();
      const int row = (v + step / 2) / step, column = (u + step / 2) / step;
      const int other_row = row * step > v ? row - 1 : row + 1;
      const int other_column = column * step > u ? column - 1 : column + 1;
      for (const auto& [r, c] :
           {std::pair(row, column), std::pair(row, other_column), std::pair(other_row, column),
            std::pair(other_row, other_column)}) {
        if (!(std::abs(grid.range[grid.at(r, c)] - range) <= max_change * range)) continue;
        const std::size_t from = static_cast<std::size_t>(r) * step * cloud.width + c * step;
        const Eigen::Vector3f normal(normals.x[from], normals.y[from], normals.z[from]);
        if (std::isnan(normal.x())) continue;
        const float sign = normal.dot(viewpoint - p) < 0 ? -1.0f : 1.0f;
        normals.x[i] = sign * normal.x();
        normals.y[i] = sign * normal.y();
        normals.z[i] = sign * normal.z();
        normals.curvature[i] = normals.curvature[from];
        break;
      }
    }
}

}  // namespace

Normals computeGridNormals(const Cloud& cloud, const Eigen::Vector3f& viewpoint,
                           const NormalsOptions& options) {
  const std::vector<float> none(cloud.size(), NONE);
  Normals normals{none, none, none, none};
  const int half = options.window / 2;
  const PaddedGrid grid(cloud, options.step, half);
  const auto change = static_cast<float>(options.depth_change);

  for (int row = 0; row < grid.rows; ++row)
    for (int column = 0; column < grid.columns; column += LANES) {
      const std::size_t first = grid.at(row, column);
      if (!grid.anyIn(first)) continue;
      LaneMoments sums;
      sumWindows(grid.x.data() + first, grid.y.data() + first, grid.z.data() + first,
                 grid.range.data() + first, grid.width, half, change, &sums);
      LaneNormals block;
      fitPlanes(sums, block);
      const int count = std::min(LANES, grid.columns - column);
      for (int l = 0; l < count; ++l) {
        const std::size_t i = static_cast<std::size_t>(row) * options.step * cloud.width +
                              (column + l) * options.step;
        const Eigen::Vector3f normal(block.x[l], block.y[l], block.z[l]);
        const float sign = normal.dot(viewpoint - cloud.point(i)) < 0 ? -1.0f : 1.0f;
        normals.x[i] = sign * normal.x();
        normals.y[i] = sign * normal.y();
        normals.z[i] = sign * normal.z();
        normals.curvature[i] = block.curvature[l];
      }
    }
  if (options.step > 1) fillBetween(cloud, grid, viewpoint, options.step, change, normals);
  return normals;
}

}  // namespace tabletop_perception
