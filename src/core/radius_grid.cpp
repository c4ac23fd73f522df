#include "radius_grid.h"

#include <algorithm>
#include <limits>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int LANES = 8;
constexpr std::size_t MAX_CUBES_PER_POINT = 8;  // more of them would take longer to clear

/// Sums in lanes: of x, y, z, of xx, xy, xz, yy, yz, zz, and how many.
struct Sums {
  alignas(32) float lanes[10][LANES] = {};
};

TABLETOP_SIMD_CLONES void addRun(const float* xs, const float* ys, const float* zs, int count,
                                 const float* p, float squared_radius, Sums& sums) {
  for (int i = 0; i < count; i += LANES)
    for (int lane = 0; lane < LANES; ++lane) {
      const float dx = xs[i + lane] - p[0], dy = ys[i + lane] - p[1], dz = zs[i + lane] - p[2];
      const bool near = (dx * dx + dy * dy + dz * dz <= squared_radius) & (lane < count - i);
      const float x = zeroUnless(near, dx), y = zeroUnless(near, dy), z = zeroUnless(near, dz);
      sums.lanes[0][lane] += x;
      sums.lanes[1][lane] += y;
      sums.lanes[2][lane] += z;
      sums.lanes[3][lane] += x * x;
      sums.lanes[4][lane] += x * y;
      sums.lanes[5][lane] += x * z;
      sums.lanes[6][lane] += y * y;
      sums.lanes[7][lane] += y * z;
      sums.lanes[8][lane] += z * z;
      sums.lanes[9][lane] += zeroUnless(near, 1);
    }
}

}  // namespace

RadiusGrid::RadiusGrid(const std::vector<Eigen::Vector3f>& points, double radius)
    : squared_radius_(static_cast<float>(radius * radius)) {
  Eigen::Vector3f high = low_ = points.empty() ? low_ : points.front();
  for (const auto& p : points) {
    low_ = low_.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double limit = static_cast<double>(MAX_CUBES_PER_POINT * (points.size() + 1));
  Eigen::Array3d size;
  for (double side = radius;; side *= 2) {
    size = ((high - low_).cast<double>().array() / side).floor() + 1;
    inverse_side_ = static_cast<float>(1 / side);
    if (size.prod() <= limit) break;
  }
  size_ = size.cast<int>();

  std::vector<int> cubes;
  begins_.assign(static_cast<std::size_t>(size_.prod()) + 1, 0);
  for (const auto& p : points) {
    const Eigen::Array3i c = cubeOf(p);
    cubes.push_back((c.z() * size_.y() + c.y()) * size_.x() + c.x());
    ++begins_[cubes.back() + 1];
  }
  for (std::size_t c = 1; c < begins_.size(); ++c) begins_[c] += begins_[c - 1];
  std::vector<int> next(begins_.begin(), begins_.end() - 1);
  for (auto* sorted : {&x_, &y_, &z_})
    sorted->assign(points.size() + LANES, std::numeric_limits<float>::quiet_NaN());
  indices_.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const int at = next[cubes[i]]++;
    x_[at] = points[i].x();
    y_[at] = points[i].y();
    z_[at] = points[i].z();
    indices_[at] = static_cast<int>(i);
  }
}

Eigen::Array3i RadiusGrid::cubeOf(const Eigen::Vector3f& p) const {
  return ((p - low_) * inverse_side_).array().cast<int>().max(0).min(size_ - 1);
}

template <typename Visit>
void RadiusGrid::visitRuns(const Eigen::Vector3f& p, Visit visit) const {
  const Eigen::Array3i c = cubeOf(p);
  const Eigen::Array3i from = (c - 1).max(0), to = (c + 1).min(size_ - 1);
  for (int z = from.z(); z <= to.z(); ++z)
    for (int y = from.y(); y <= to.y(); ++y) {
      const int row = (z * size_.y() + y) * size_.x();
      const int first = begins_[row + from.x()], end = begins_[row + to.x() + 1];
      if (first < end) visit(first, end);
    }
}

Moments RadiusGrid::momentsAbout(const Eigen::Vector3f& p) const {
  Sums sums;
  visitRuns(p, [&](int first, int end) {
    addRun(&x_[first], &y_[first], &z_[first], end - first, p.data(), squared_radius_, sums);
  });
  float all[10] = {};
  for (int k = 0; k < 10; ++k)
    for (const float lane : sums.lanes[k]) all[k] += lane;
  Moments moments;
  moments.sum << all[0], all[1], all[2];
  moments.products << all[3], all[4], all[5], all[4], all[6], all[7], all[5], all[7], all[8];
  moments.count = static_cast<int>(all[9]);
  return moments;
}

void RadiusGrid::appendWithin(const Eigen::Vector3f& p, std::vector<int>& indices) const {
  visitRuns(p, [&](int first, int end) {
    for (int i = first; i < end; ++i) {
      const float dx = x_[i] - p.x(), dy = y_[i] - p.y(), dz = z_[i] - p.z();
      if (dx * dx + dy * dy + dz * dz <= squared_radius_) indices.push_back(indices_[i]);
    }
  });
}

}  // namespace tabletop_perception
