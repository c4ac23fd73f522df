#include "plane_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int MAX_DRAWS = 2000;
constexpr double CONFIDENCE = 0.999;  // that one draw had inliers alone
constexpr int LANES = 8;              // points that a kernel takes at once: sums stay in registers
constexpr std::size_t BLOCK = 4096;   // points summed in single precision before doubles take over
constexpr std::size_t MARKS = 512;    // that are turned into indices at once
constexpr std::size_t VALID_BLOCK = 64;  // points among which one of a sample is sought

/// Count, sums and products of coordinates: 1, x y z, xx xy xz yy yz zz.
using Moments = std::array<double, 10>;

/// Adds the moments, about `middle`, of the points within `band` of a plane, among every
/// `share`-th group of LANES points. `count` is a multiple of LANES.
TABLETOP_SIMD_CLONES
void addMoments(const float* x, const float* y, const float* z, std::size_t count, int share,
                const float* plane, float band, const float* middle, double* moments) {
  const float a = plane[0], b = plane[1], c = plane[2], d = plane[3];
  const float mx = middle[0], my = middle[1], mz = middle[2];
  float sums[10][LANES] = {};
  for (std::size_t i = 0; i < count; i += static_cast<std::size_t>(share) * LANES)
    for (int l = 0; l < LANES; ++l) {
      const float px = x[i + l], py = y[i + l], pz = z[i + l];
      const bool near = std::abs(a * px + b * py + c * pz + d) <= band;  // false for NaN
      const float dx = zeroUnless(near, px - mx), dy = zeroUnless(near, py - my),
                  dz = zeroUnless(near, pz - mz);
      sums[0][l] += zeroUnless(near, 1.0f);
      sums[1][l] += dx;
      sums[2][l] += dy;
      sums[3][l] += dz;
      sums[4][l] += dx * dx;
      sums[5][l] += dx * dy;
      sums[6][l] += dx * dz;
      sums[7][l] += dy * dy;
      sums[8][l] += dy * dz;
      sums[9][l] += dz * dz;
    }
  for (int k = 0; k < 10; ++k)
    for (int l = 0; l < LANES; ++l) moments[k] += static_cast<double>(sums[k][l]);
}

/// How many points lie within `distance` of a plane. `count` is a multiple of LANES.
TABLETOP_SIMD_CLONES
int countNear(const float* x, const float* y, const float* z, std::size_t count, const float* plane,
              float distance) {
  const float a = plane[0], b = plane[1], c = plane[2], d = plane[3];
  int near[LANES] = {};
  for (std::size_t i = 0; i < count; i += LANES)
    for (int l = 0; l < LANES; ++l)
      near[l] += std::abs(a * x[i + l] + b * y[i + l] + c * z[i + l] + d) <= distance ? 1 : 0;
  int sum = 0;
  for (const int lane : near) sum += lane;
  return sum;
}

/// Marks the points whose signed distance from a plane is from `low` to `high`.
TABLETOP_SIMD_CLONES
void markBetween(const float* x, const float* y, const float* z, std::size_t count,
                 const float* plane, float low, float high, std::uint8_t* marks) {
  const float a = plane[0], b = plane[1], c = plane[2], d = plane[3];
  for (std::size_t i = 0; i < count; ++i) {
    const float distance = a * x[i] + b * y[i] + c * z[i] + d;
    marks[i] = (distance >= low) & (distance <= high);  // false for NaN
  }
}

/// Appends the indices, from `first` on, of at most MARKS marks that are 1. Points that are marked
/// come in runs, so most groups are all or nothing.
void appendMarked(const std::uint8_t* marks, std::size_t count, std::size_t first,
                  Indices& indices) {
  constexpr std::size_t GROUP = 8;
  constexpr std::uint64_t ALL = 0x0101010101010101;
  int found[MARKS];
  int* end = found;
  const auto take = [&](std::size_t i) {
    *end = static_cast<int>(first + i);  // kept only if the next line counts it
    end += marks[i];
  };
  std::size_t i = 0;
  for (; i + GROUP <= count; i += GROUP) {
    std::uint64_t group;
    std::memcpy(&group, marks + i, GROUP);
    if (group == 0) continue;
    if (group == ALL) {
      for (std::size_t k = 0; k < GROUP; ++k) end[k] = static_cast<int>(first + i + k);
      end += GROUP;
    } else {
      for (std::size_t k = 0; k < GROUP; ++k) take(i + k);
    }
  }
  for (; i < count; ++i) take(i);
  indices.insert(indices.end(), found, end);
}

/// The points' arrays, lengthened to a multiple of LANES by pixels without a point.
struct PaddedPoints {
  std::vector<float> x, y, z;

  PaddedPoints(const Cloud& cloud, std::size_t first) {
    const std::size_t count = (cloud.size() - first + LANES - 1) / LANES * LANES;
    const auto copy = [&](const std::vector<float>& from) {
      std::vector<float> to(from.begin() + static_cast<std::ptrdiff_t>(first), from.end());
      to.resize(count, std::numeric_limits<float>::quiet_NaN());
      return to;
    };
    x = copy(cloud.x);
    y = copy(cloud.y);
    z = copy(cloud.z);
  }
};

/// Whether any of some points is valid. Cameras see nothing over large parts of a picture, of which
/// one coordinate is enough to look at.
TABLETOP_SIMD_CLONES
bool anyValid(const float* x, std::size_t count) {
  int valid = 0;
  for (std::size_t i = 0; i < count; ++i) valid |= x[i] == x[i] ? 1 : 0;  // not for NaN
  return valid != 0;
}

/// Counts the valid points of each of so many blocks.
TABLETOP_SIMD_CLONES
void countValid(const float* x, std::size_t blocks, int* valid) {
  for (std::size_t b = 0; b < blocks; ++b) {
    int count = 0;
    for (std::size_t i = 0; i < VALID_BLOCK; ++i)
      count += x[b * VALID_BLOCK + i] == x[b * VALID_BLOCK + i] ? 1 : 0;  // not for NaN
    valid[b] = count;
  }
}

/// Valid points in each block of VALID_BLOCK points, the last of which may be shorter.
std::vector<int> validByBlock(const Cloud& cloud) {
  const std::size_t whole = cloud.size() / VALID_BLOCK;
  std::vector<int> valid(whole);
  countValid(cloud.x.data(), whole, valid.data());
  int rest = 0;
  for (std::size_t i = whole * VALID_BLOCK; i < cloud.size(); ++i) rest += cloud.valid(i);
  valid.push_back(rest);
  return valid;
}

Moments momentsNear(const Cloud& cloud, const Eigen::Vector4d& near, double band, int share,
                    const Eigen::Vector3d& middle) {
  const Eigen::Vector4f plane = near.cast<float>();
  const Eigen::Vector3f center = middle.cast<float>();
  Moments moments{};
  const std::size_t whole = cloud.size() / LANES * LANES;
  for (std::size_t i = 0; i < whole; i += BLOCK) {
    const std::size_t count = std::min(BLOCK, whole - i);
    if (!anyValid(&cloud.x[i], count)) continue;
    addMoments(&cloud.x[i], &cloud.y[i], &cloud.z[i], count, share, plane.data(),
               static_cast<float>(band), center.data(), moments.data());
  }
  const PaddedPoints rest(cloud, whole);
  addMoments(rest.x.data(), rest.y.data(), rest.z.data(), rest.x.size(), share, plane.data(),
             static_cast<float>(band), center.data(), moments.data());
  return moments;
}

}  // namespace

Indices indicesOf(const std::vector<std::uint8_t>& marks) {
  Indices indices;
  indices.reserve(marks.size());
  for (std::size_t i = 0; i < marks.size(); i += MARKS)
    appendMarked(&marks[i], std::min(MARKS, marks.size() - i), i, indices);
  return indices;
}

std::optional<PlaneFit> fitPlaneNear(const Cloud& cloud, const Eigen::Vector4d& near, double band,
                                     int share) {
  // About the plane's point nearest to the sensor: products stay small in single precision.
  const Eigen::Vector3d middle = (-near[3] * near.head<3>()).cast<float>().cast<double>();
  const Moments m = momentsNear(cloud, near, band, share, middle);
  const double n = m[0];
  if (n < 3) return std::nullopt;
  const Eigen::Vector3d mean(m[1] / n, m[2] / n, m[3] / n);
  Eigen::Matrix3d covariance;
  covariance << m[4], m[5], m[6], m[5], m[7], m[8], m[6], m[8], m[9];
  covariance = covariance / n - mean * mean.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  const Eigen::Vector3d normal = solver.eigenvectors().col(0);
  PlaneFit fit;
  fit.centroid = mean + middle;
  fit.plane << normal, -normal.dot(fit.centroid);
  fit.rms = std::sqrt(std::max(0.0, solver.eigenvalues()[0]));
  fit.points = static_cast<std::size_t>(n);
  return fit;
}

std::size_t countNearPlane(const Cloud& cloud, const Eigen::Vector4d& plane, double distance) {
  const Eigen::Vector4f q = plane.cast<float>();
  const std::size_t whole = cloud.size() / LANES * LANES;
  const auto near = static_cast<float>(distance);
  const PaddedPoints rest(cloud, whole);
  return countNear(cloud.x.data(), cloud.y.data(), cloud.z.data(), whole, q.data(), near) +
         countNear(rest.x.data(), rest.y.data(), rest.z.data(), rest.x.size(), q.data(), near);
}

Indices pointsNearPlane(const Cloud& cloud, const Eigen::Vector4d& plane, double distance) {
  return pointsBetween(cloud, plane, -distance, distance);
}

Indices pointsBetween(const Cloud& cloud, const Eigen::Vector4d& plane, double low, double high) {
  Indices between;
  between.reserve(cloud.size());
  appendBetween(cloud, 0, cloud.size(), plane, low, high, between);
  return between;
}

void appendBetween(const Cloud& cloud, std::size_t begin, std::size_t end,
                   const Eigen::Vector4d& plane, double low, double high, Indices& between) {
  const Eigen::Vector4f q = plane.cast<float>();
  std::uint8_t marks[MARKS];  // of a few points: they stay cached
  for (std::size_t i = begin; i < end; i += MARKS) {
    const std::size_t count = std::min(MARKS, end - i);
    if (!anyValid(&cloud.x[i], count)) continue;
    markBetween(&cloud.x[i], &cloud.y[i], &cloud.z[i], count, q.data(), static_cast<float>(low),
                static_cast<float>(high), marks);
    appendMarked(marks, count, i, between);
  }
}

Cloud samplePoints(const Cloud& cloud, std::size_t size) {
  const std::vector<int> valid = validByBlock(cloud);
  const auto total = static_cast<std::size_t>(std::accumulate(valid.begin(), valid.end(), 0));
  const double stretch = std::max(1.0, static_cast<double>(total) / static_cast<double>(size));
  // One by chance out of each stretch: at even steps the rows of a camera would line up.
  std::minstd_rand random(1);
  std::uniform_real_distribution<double> within(0, stretch);
  Indices sample;
  std::size_t block = 0, before = 0;  // valid points before the block
  for (double begin = 0; begin < static_cast<double>(total); begin += stretch) {
    const auto rank = static_cast<std::size_t>(begin + (stretch > 1 ? within(random) : 0.5));
    if (rank >= total) break;
    while (before + valid[block] <= rank) before += valid[block++];
    std::size_t i = block * VALID_BLOCK;
    if (valid[block] == static_cast<int>(VALID_BLOCK))
      i += rank - before;
    else
      for (std::size_t skipped = before; skipped < rank || !cloud.valid(i); ++i)
        skipped += cloud.valid(i);
    sample.push_back(static_cast<int>(i));
  }
  return selectPoints(cloud, sample);
}

std::optional<Eigen::Vector4d> drawPlane(const Cloud& sample, double distance,
                                         const std::optional<PlaneConstraint>& constraint,
                                         std::mt19937& random) {
  if (sample.size() < 3) return std::nullopt;
  const PaddedPoints points(sample, 0);
  const auto draw = [&]() -> Eigen::Vector3d {
    return sample.point(random() % sample.size()).cast<double>();
  };
  std::optional<Eigen::Vector4d> best;
  int most = 0;
  int needed = MAX_DRAWS;
  for (int i = 0; i < needed; ++i) {
    const Eigen::Vector3d a = draw(), b = draw(), c = draw();
    const Eigen::Vector3d cross = (b - a).cross(c - a);
    if (cross.norm() < 1e-9) continue;
    const Eigen::Vector3d normal = cross.normalized();
    if (constraint && std::abs(normal.dot(constraint->direction)) < constraint->min_cosine)
      continue;

    Eigen::Vector4d plane;
    plane << normal, -normal.dot(a);
    const Eigen::Vector4f q = plane.cast<float>();
    const int near = countNear(points.x.data(), points.y.data(), points.z.data(), points.x.size(),
                               q.data(), static_cast<float>(distance));
    if (near <= most) continue;
    most = near;
    best = plane;
    const double share = static_cast<double>(near) / static_cast<double>(sample.size());
    const double miss = 1 - share * share * share;
    if (miss < 1)
      needed =
          std::min(needed, static_cast<int>(std::ceil(std::log(1 - CONFIDENCE) / std::log(miss))));
  }
  return best;
}

}  // namespace tabletop_perception
