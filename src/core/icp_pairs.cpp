#include "icp_pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include <Eigen/LU>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int SIZE = PlanarBlock::SIZE;
constexpr int LANES = 8;    // sums side by side, as many as a wide register holds
constexpr int COLUMNS = 7;  // of the equations: turn, shift, right-hand side
constexpr int PRODUCTS = COLUMNS * (COLUMNS + 1) / 2;
constexpr int BINS = 64;             // of squared distances
constexpr std::size_t COUNTERS = 4;  // of each bin; divides SIZE
constexpr double FLATNESS = 1e-3;    // of GICP's surfaces: variance across over along them

/// Sums of the products of every two columns of the linearised equations, in lanes.
struct Products {
  alignas(32) float lanes[PRODUCTS][LANES] = {};
};

/// Adds the equations of one block's correspondences up to `farthest`: row ((p - c) x n, n) times
/// the motion is n . d.
TABLETOP_SIMD_CLONES void addPlanes(const Correspondences& block, float farthest,
                                    const float* center, Products& products) {
  alignas(32) float columns[COLUMNS][SIZE];
  for (int i = 0; i < SIZE; ++i) {
    const bool counts = block.squared[i] <= farthest;
    const float x = zeroUnless(counts, block.x[i] - center[0]);
    const float y = zeroUnless(counts, block.y[i] - center[1]);
    const float z = zeroUnless(counts, block.z[i] - center[2]);
    const float nx = zeroUnless(counts, block.nx[i]);
    const float ny = zeroUnless(counts, block.ny[i]);
    const float nz = zeroUnless(counts, block.nz[i]);
    columns[0][i] = y * nz - z * ny;
    columns[1][i] = z * nx - x * nz;
    columns[2][i] = x * ny - y * nx;
    columns[3][i] = nx;
    columns[4][i] = ny;
    columns[5][i] = nz;
    columns[6][i] = zeroUnless(counts, block.dx[i]) * nx + zeroUnless(counts, block.dy[i]) * ny +
                    zeroUnless(counts, block.dz[i]) * nz;
  }
  int k = 0;
  for (int a = 0; a < COLUMNS; ++a)
    for (int b = a; b < COLUMNS; ++b, ++k)
      for (int i = 0; i < SIZE; i += LANES)
        for (int lane = 0; lane < LANES; ++lane)
          products.lanes[k][lane] += columns[a][i + lane] * columns[b][i + lane];
}

/// The bin of each squared distance; BINS where there is no correspondence.
TABLETOP_SIMD_CLONES void binDistances(const float* squared, float bins_per_squared,
                                       std::uint8_t* bins) {
  std::int32_t wide[SIZE];
  for (int i = 0; i < SIZE; ++i)
    wide[i] = static_cast<std::int32_t>(std::min(squared[i] * bins_per_squared, BINS - 1.0f)) +
              (squared[i] > std::numeric_limits<float>::max());
  for (int i = 0; i < SIZE; ++i) bins[i] = static_cast<std::uint8_t>(wide[i]);
}

NormalEquations equationsOfPlanes(const IcpPairs& pairs, const Eigen::Vector3d& center) {
  const Eigen::Vector3f c = center.cast<float>();
  Products products;
  for (const auto& block : pairs.blocks()) addPlanes(block, pairs.farthest(), c.data(), products);
  Eigen::Matrix<double, COLUMNS, COLUMNS> all;
  int k = 0;
  for (int a = 0; a < COLUMNS; ++a)
    for (int b = a; b < COLUMNS; ++b, ++k) {
      double sum = 0;
      for (const float lane : products.lanes[k]) sum += lane;
      all(a, b) = all(b, a) = sum;
    }
  return {all.topLeftCorner<6, 6>(), all.topRightCorner<6, 1>()};
}

Eigen::Matrix3d crossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

/// Pairs whose differences d count by a weight each: d^T W d. `weightOf(n, m)`: of the model's
/// normal and the cluster's.
template <typename Weight>
NormalEquations weightedEquations(const IcpPairs& pairs, const Eigen::Vector3d& center,
                                  Weight weightOf) {
  const Eigen::Matrix3d R = pairs.pose().linear();
  NormalEquations equations;
  pairs.visitKept([&](const Correspondences& block, int i, const PlanarBlock& source) {
    const Eigen::Vector3d p(block.x[i], block.y[i], block.z[i]);
    const Eigen::Vector3d d(block.dx[i], block.dy[i], block.dz[i]);
    const Eigen::Vector3d normal(block.nx[i], block.ny[i], block.nz[i]);
    const Eigen::Matrix3d weight = weightOf(
        normal, Eigen::Vector3d(R * Eigen::Vector3d(source.nx[i], source.ny[i], source.nz[i])));
    Eigen::Matrix<double, 3, 6> J;  // of the point's motion
    J << -crossMatrix(p - center), Eigen::Matrix3d::Identity();
    const Eigen::Matrix<double, 6, 3> weighted = J.transpose() * weight;
    equations.A += weighted * J;
    equations.b += weighted * d;
  });
  return equations;
}

/// The covariance of a point of a surface, up to a factor: flat about its normal.
Eigen::Matrix3d flatAbout(const Eigen::Vector3d& normal) {
  return Eigen::Matrix3d::Identity() - (1 - FLATNESS) * normal * normal.transpose();
}

}  // namespace

IcpPairs::IcpPairs(const PlanarSurface& cluster)
    : cluster_(cluster), blocks_(cluster.blocks.size()), bins_(cluster.blocks.size() * SIZE) {}

void IcpPairs::find(const NearestGrid& model, const Eigen::Isometry3d& T_object_camera,
                    double max_distance, double trim) {
  T_object_camera_ = T_object_camera;
  const Eigen::Isometry3f T = T_object_camera.cast<float>();
  for (std::size_t b = 0; b < blocks_.size(); ++b)
    model.correspond(cluster_.blocks[b], T, static_cast<float>(max_distance * max_distance),
                     blocks_[b]);
  keepNearest(trim, static_cast<float>(BINS / (max_distance * max_distance)));
}

double IcpPairs::rms() const {
  double sum = 0;
  for (const auto& block : blocks_)
    for (const float squared : block.squared) sum += squared <= farthest_ ? squared : 0;
  return std::sqrt(sum / static_cast<double>(kept_));
}

/// Which are the nearest `trim` of them: counted in bins, sorted out in the last one alone.
void IcpPairs::keepNearest(double trim, float bins_per_squared) {
  for (std::size_t b = 0; b < blocks_.size(); ++b)
    binDistances(blocks_[b].squared, bins_per_squared, &bins_[b * SIZE]);
  // Several counts of each, for one that was just written takes long to be read again.
  std::array<std::array<std::uint32_t, BINS + 1>, COUNTERS> counters{};
  for (std::size_t i = 0; i < bins_.size(); i += COUNTERS)
    for (std::size_t c = 0; c < COUNTERS; ++c) ++counters[c][bins_[i + c]];
  const auto countOf = [&](int bin) {
    std::size_t count = 0;
    for (const auto& counter : counters) count += counter[bin];
    return count;
  };
  found_ = bins_.size() - countOf(BINS);
  farthest_ = -1;
  kept_ = static_cast<std::size_t>(std::ceil(trim * static_cast<double>(found_)));
  if (kept_ == 0) return;
  int last_bin = 0;
  std::size_t before = 0;
  for (std::size_t count; before + (count = countOf(last_bin)) < kept_; ++last_bin) before += count;
  of_last_bin_.clear();
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const std::uint8_t* const bins = &bins_[b * SIZE];
    if (std::memchr(bins, last_bin, SIZE) == nullptr) continue;
    for (int i = 0; i < SIZE; ++i)
      if (bins[i] == last_bin) of_last_bin_.push_back(blocks_[b].squared[i]);
  }
  const auto last = of_last_bin_.begin() + static_cast<std::ptrdiff_t>(kept_ - before) - 1;
  std::nth_element(of_last_bin_.begin(), last, of_last_bin_.end());
  farthest_ = *last;
}

NormalEquations normalEquations(const IcpPairs& pairs, const Eigen::Vector3d& center,
                                const std::string& method) {
  if (method == "point_to_plane") return equationsOfPlanes(pairs, center);
  if (method == "point_to_point")
    return weightedEquations(pairs, center, [](const Eigen::Vector3d&, const Eigen::Vector3d&) {
      return Eigen::Matrix3d::Identity();
    });
  return weightedEquations(pairs, center, [](const Eigen::Vector3d& n, const Eigen::Vector3d& m) {
    return Eigen::Matrix3d((flatAbout(n) + flatAbout(m)).inverse());
  });
}

}  // namespace tabletop_perception
