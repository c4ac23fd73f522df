#include "plane_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "plane_fit.h"
#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t GROUP = 16;    // points that are looked at together
constexpr std::size_t COUNTED = 32;  // points of one row that are counted or left out together
constexpr std::size_t IN_TURN = 16;  // such stretches of which points are counted in turn

inline float dot(const float* row, float x, float y, float z) {
  return row[0] * x + row[1] * y + row[2] * z + row[3];
}

inline float clampTo(float value, float low, float high) {
  const float raised = value < low ? low : value;
  return raised > high ? high : raised;
}

inline bool anyNear(const float* x, const float* y, const float* z, const float* height,
                    float distance) {
  int near = 0;
  for (std::size_t l = 0; l < GROUP; ++l)
    near |= std::abs(dot(height, x[l], y[l], z[l])) <= distance ? 1 : 0;
  return near != 0;
}

/// How many groups of points, from the first on, have none near the plane.
TABLETOP_SIMD_CLONES
std::size_t groupsBefore(const float* x, const float* y, const float* z, std::size_t groups,
                         const float* height, float distance) {
  std::size_t g = 0;
  while (g < groups && !anyNear(x + g * GROUP, y + g * GROUP, z + g * GROUP, height, distance)) ++g;
  return g;
}

/// The same from the last group back.
TABLETOP_SIMD_CLONES
std::size_t groupsBehind(const float* x, const float* y, const float* z, std::size_t groups,
                         const float* height, float distance) {
  std::size_t g = groups;
  while (g > 0 &&
         !anyNear(x + (g - 1) * GROUP, y + (g - 1) * GROUP, z + (g - 1) * GROUP, height, distance))
    --g;
  return groups - g;
}

struct Grid {
  float low_u, low_v, cells_per_metre, last_column, last_row;
  int columns;
};

/// The cells of all points, those beyond the raster's border in its outermost cells.
TABLETOP_SIMD_CLONES
void placeInCells(const float* x, const float* y, const float* z, std::size_t count, const float* u,
                  const float* v, const float* height, float distance, const Grid& grid,
                  int* cell) {
  const Grid g = grid;
  for (std::size_t i = 0; i < count; ++i) {
    const bool near = std::abs(dot(height, x[i], y[i], z[i])) <= distance;
    const float column =
        clampTo((dot(u, x[i], y[i], z[i]) - g.low_u) * g.cells_per_metre, 1, g.last_column);
    const float row =
        clampTo((dot(v, x[i], y[i], z[i]) - g.low_v) * g.cells_per_metre, 1, g.last_row);
    cell[i] = static_cast<int>(zeroUnless(near, row)) * g.columns +
              static_cast<int>(zeroUnless(near, column));
  }
}

}  // namespace

PlaneRaster::PlaneRaster(const Cloud& cloud, const Eigen::Isometry3d& T_camera_plane,
                         double distance, double side, int max_cells)
    : cloud_(cloud), distance_(static_cast<float>(distance)) {
  const Eigen::Matrix4f T = T_camera_plane.inverse().matrix().cast<float>();
  for (int k = 0; k < 4; ++k) {
    to_plane_.u[k] = T(0, k);
    to_plane_.v[k] = T(1, k);
    to_plane_.height[k] = T(2, k);
  }
  findStretches();
  layOver(side, max_cells);
}

void PlaneRaster::findStretches() {
  if (!cloud_.organized()) {
    const Eigen::Vector4d plane =
        Eigen::Map<const Eigen::Vector4f>(to_plane_.height).cast<double>();
    for (const int i : pointsNearPlane(cloud_, plane, distance_)) stretches_.push_back({i, i});
    return;
  }
  const auto near = [&](int i) {
    return std::abs(dot(to_plane_.height, cloud_.x[i], cloud_.y[i], cloud_.z[i])) <= distance_;
  };
  const std::size_t groups = static_cast<std::size_t>(cloud_.width) / GROUP;
  for (int row = 0; row < cloud_.height; ++row) {
    const int begin = row * cloud_.width;
    const auto skipped = [&](const auto& groupsWithout, int from) {
      return static_cast<int>(GROUP * groupsWithout(&cloud_.x[from], &cloud_.y[from],
                                                    &cloud_.z[from], groups, to_plane_.height,
                                                    distance_));
    };
    int first = begin + skipped(groupsBefore, begin), last = begin + cloud_.width - 1;
    while (first <= last && !near(first)) ++first;
    if (first > last) continue;
    last -= skipped(groupsBehind, last + 1 - static_cast<int>(groups * GROUP));
    while (!near(last)) --last;
    stretches_.push_back({first, last});
  }
}

void PlaneRaster::layOver(double side, int max_cells) {
  if (stretches_.empty()) return;
  constexpr float FAR = std::numeric_limits<float>::max();
  float low_u = FAR, high_u = -FAR, low_v = FAR, high_v = -FAR;
  const auto add = [&](int i) {
    const float u = dot(to_plane_.u, cloud_.x[i], cloud_.y[i], cloud_.z[i]);
    const float v = dot(to_plane_.v, cloud_.x[i], cloud_.y[i], cloud_.z[i]);
    low_u = std::min(low_u, u);
    high_u = std::max(high_u, u);
    low_v = std::min(low_v, v);
    high_v = std::max(high_v, v);
  };
  for (const auto& stretch : stretches_) {
    add(stretch.first);
    add(stretch.last);
  }
  const float width = high_u - low_u, height = high_v - low_v;
  const float cell = std::max(static_cast<float>(side), std::max(width, height) / max_cells);
  columns_ = static_cast<int>(width / cell) + 3;
  rows_ = static_cast<int>(height / cell) + 3;
  low_u_ = low_u - cell;
  low_v_ = low_v - cell;
  cells_per_metre_ = 1 / cell;
}

void PlaneRaster::cellsOf(std::size_t first, std::size_t count, int* cells) const {
  if (stretches_.empty())
    std::fill_n(cells, count, 0);
  else
    placeInCells(&cloud_.x[first], &cloud_.y[first], &cloud_.z[first], count, to_plane_.u,
                 to_plane_.v, to_plane_.height, distance_,
                 {low_u_, low_v_, cells_per_metre_, static_cast<float>(columns_ - 2),
                  static_cast<float>(rows_ - 2), columns_},
                 cells);
}

int PlaneRaster::cellOf(std::size_t point) const {
  int cell;
  cellsOf(point, 1, &cell);
  return cell;
}

std::vector<int> PlaneRaster::pointsByCell() const {
  std::vector<int> counts(static_cast<std::size_t>(columns_) * rows_, 0);
  // Points side by side mostly share a cell: taken in turn from several stretches, none has to wait
  // until the one before is counted.
  std::array<int, COUNTED * IN_TURN> cells;
  std::size_t stretches = 0;
  const auto count = [&] {
    for (std::size_t l = 0; l < COUNTED; ++l)
      for (std::size_t g = 0; g < stretches; ++g) ++counts[cells[g * COUNTED + l]];
    stretches = 0;
  };
  const int share = shareOf(cloud_.size());
  const auto width = static_cast<std::size_t>(cloud_.width);
  for (int row = 0; row < cloud_.height; ++row) {
    // Each row begins at another stretch: no column of pixels is left out.
    for (std::size_t column = row % share * COUNTED; column < width; column += share * COUNTED) {
      const std::size_t length = std::min(COUNTED, width - column);
      int* place = &cells[stretches++ * COUNTED];
      cellsOf(row * width + column, length, place);
      std::fill(place + length, place + COUNTED, 0);
      if (stretches == IN_TURN) count();
    }
  }
  count();
  counts[0] = 0;
  return counts;
}

}  // namespace tabletop_perception
