#include "radius_grid.h"

#include <algorithm>
#include <array>
#include <limits>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int LANES = 8;
constexpr int MAX_RUNS = 9;                     // of points about a point
constexpr std::size_t MAX_CUBES_PER_POINT = 8;  // more of them would take longer to clear

constexpr int CHUNK = 64;  // of a run whose distances are taken at once; a multiple of LANES
constexpr int SUMS = 10;   // x, y, z, xx, xy, xz, yy, yz, zz, and how many

/// Sorted points from one on.
struct Run {
  int first, count;
};

/// Sums over the points of some runs within the radius of `p`, relative to it.
TABLETOP_SIMD_CLONES void sumRuns(const float* __restrict xs, const float* __restrict ys,
                                  const float* __restrict zs, const Run* __restrict runs,
                                  int run_count, const float* __restrict p, float squared_radius,
                                  float* __restrict sums) {
  alignas(32) float lanes[SUMS][LANES] = {};
  for (int r = 0; r < run_count; ++r)
    for (int i = 0; i < runs[r].count; i += LANES) {
      const int first = runs[r].first + i, left = runs[r].count - i;
      for (int lane = 0; lane < LANES; ++lane) {
        const float dx = xs[first + lane] - p[0], dy = ys[first + lane] - p[1],
                    dz = zs[first + lane] - p[2];
        const bool near = (dx * dx + dy * dy + dz * dz <= squared_radius) & (lane < left);
        const float x = zeroUnless(near, dx), y = zeroUnless(near, dy), z = zeroUnless(near, dz);
        lanes[0][lane] += x;
        lanes[1][lane] += y;
        lanes[2][lane] += z;
        lanes[3][lane] += x * x;
        lanes[4][lane] += x * y;
        lanes[5][lane] += x * z;
        lanes[6][lane] += y * y;
        lanes[7][lane] += y * z;
        lanes[8][lane] += z * z;
        lanes[9][lane] += zeroUnless(near, 1);
      }
    }
  for (int k = 0; k < SUMS; ++k) {
    sums[k] = 0;
    for (int lane = 0; lane < LANES; ++lane) sums[k] += lanes[k][lane];
  }
}

/// Squared distances of some points from `p`.
TABLETOP_SIMD_CLONES void squaredDistances(const float* __restrict xs, const float* __restrict ys,
                                           const float* __restrict zs, int count,
                                           const float* __restrict p, float* __restrict squared) {
  for (int i = 0; i < count; i += LANES)
    for (int lane = i; lane < i + LANES; ++lane) {
      const float dx = xs[lane] - p[0], dy = ys[lane] - p[1], dz = zs[lane] - p[2];
      squared[lane] = dx * dx + dy * dy + dz * dz;
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
  std::array<Run, MAX_RUNS> runs;
  int count = 0;
  visitRuns(p, [&](int first, int end) { runs[count++] = {first, end - first}; });
  float all[SUMS];
  sumRuns(x_.data(), y_.data(), z_.data(), runs.data(), count, p.data(), squared_radius_, all);
  Moments moments;
  moments.sum << all[0], all[1], all[2];
  moments.products << all[3], all[4], all[5], all[4], all[6], all[7], all[5], all[7], all[8];
  moments.count = static_cast<int>(all[9]);
  return moments;
}

void RadiusGrid::appendWithin(const Eigen::Vector3f& p, std::vector<int>& indices) const {
  alignas(32) std::array<float, CHUNK> squared;
  visitRuns(p, [&](int first, int end) {
    for (; first < end; first += CHUNK) {
      const int count = std::min(CHUNK, end - first);
      squaredDistances(&x_[first], &y_[first], &z_[first], count, p.data(), squared.data());
      // All are written, those within stay: which ones are is hard to foresee for a processor.
      std::size_t size = indices.size();
      indices.resize(size + count);
      for (int i = 0; i < count; ++i) {
        indices[size] = indices_[first + i];
        size += squared[i] <= squared_radius_;
      }
      indices.resize(size);
    }
  });
}

}  // namespace tabletop_perception
