#include "tabletop_perception/refine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include <Eigen/Cholesky>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr double SHRINK = 0.8;  // of the correspondence distance per iteration
constexpr double DAMPING =
    1e-2;  // of the normal equations' mean diagonal: free directions stay put
constexpr int MIN_POINTS = 6;
constexpr int SIZE = PlanarBlock::SIZE;
constexpr int LANES = 8;    // sums side by side, as many as a wide register holds
constexpr int COLUMNS = 7;  // of the equations: turn, shift, right-hand side
constexpr int PRODUCTS = COLUMNS * (COLUMNS + 1) / 2;

/// Sums of the products of every two columns of the linearised equations, in lanes.
struct Products {
  alignas(32) float lanes[PRODUCTS][LANES] = {};
};

/// The correspondences of a cluster at a pose.
class Pairs {
 public:
  explicit Pairs(std::size_t blocks) : blocks_(blocks) {}

  /// Finds them anew, none farther than `max_distance`, and keeps the nearest `trim` of them.
  void find(const PlanarSurface& cluster, const NearestGrid& model,
            const Eigen::Isometry3d& T_object_camera, double max_distance, double trim) {
    const Eigen::Isometry3f T = T_object_camera.cast<float>();
    for (std::size_t b = 0; b < blocks_.size(); ++b)
      model.correspond(cluster.blocks[b], T, static_cast<float>(max_distance * max_distance),
                       blocks_[b]);
    keepNearest(trim, static_cast<float>(BINS / (max_distance * max_distance)));
  }

  int found() const { return static_cast<int>(found_); }
  int kept() const { return static_cast<int>(kept_); }
  const std::vector<Correspondences>& blocks() const { return blocks_; }
  float farthest() const { return farthest_; }  ///< squared distance of those kept [m^2]

  double rms() const {
    double sum = 0;
    for (const auto& block : blocks_)
      for (const float squared : block.squared) sum += squared <= farthest_ ? squared : 0;
    return std::sqrt(sum / static_cast<double>(kept_));
  }

 private:
  static constexpr int BINS = 64;  // of squared distances

  /// Which are the nearest `trim` of them: counted in bins, sorted out in the last one alone.
  void keepNearest(double trim, float bins_per_squared) {
    std::array<std::size_t, BINS + 1> counts{};
    const auto binOf = [&](float squared) {
      return static_cast<int>(std::min(squared * bins_per_squared, static_cast<float>(BINS)));
    };
    found_ = 0;
    for (const auto& block : blocks_)
      for (const float squared : block.squared) {
        const bool is_one = std::isfinite(squared);
        found_ += is_one;
        counts[is_one ? binOf(squared) : BINS] += is_one;
      }
    farthest_ = -1;
    kept_ = static_cast<std::size_t>(std::ceil(trim * static_cast<double>(found_)));
    if (kept_ == 0) return;
    int last_bin = 0;
    std::size_t before = 0;
    while (before + counts[last_bin] < kept_) before += counts[last_bin++];
    of_last_bin_.clear();
    for (const auto& block : blocks_)
      for (const float squared : block.squared)
        if (std::isfinite(squared) && binOf(squared) == last_bin) of_last_bin_.push_back(squared);
    const auto last = of_last_bin_.begin() + static_cast<std::ptrdiff_t>(kept_ - before) - 1;
    std::nth_element(of_last_bin_.begin(), last, of_last_bin_.end());
    farthest_ = *last;
  }

  std::vector<Correspondences> blocks_;
  std::vector<float> of_last_bin_;
  std::size_t found_ = 0, kept_ = 0;
  float farthest_ = -1;
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

/// Least squares A x = b, and the sum of squares c of the right-hand side.
struct NormalEquations {
  Eigen::Matrix<double, 6, 6> A;
  Eigen::Matrix<double, 6, 1> b;
  double c;
};

NormalEquations equationsOfPlanes(const Pairs& pairs, const Eigen::Vector3d& center) {
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
  return {all.topLeftCorner<6, 6>(), all.topRightCorner<6, 1>(), all(6, 6)};
}

/// A small motion: a turn about `center`, then a shift.
Eigen::Isometry3d motionOf(const Eigen::Matrix<double, 6, 1>& x, const Eigen::Vector3d& center) {
  const Eigen::Vector3d turn = x.head<3>();
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  if (turn.norm() > 0)
    motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  motion.translation() = center - motion.linear() * center + x.tail<3>();
  return motion;
}

/// The motion of the source that brings it onto the targets' tangent planes, to first order.
Eigen::Isometry3d stepToPlanes(const Pairs& pairs, const Eigen::Vector3d& center) {
  auto equations = equationsOfPlanes(pairs, center);
  auto diagonal = equations.A.diagonal();
  const double rotation = diagonal.head<3>().mean(), shift = diagonal.tail<3>().mean();
  diagonal.head<3>().array() += DAMPING * rotation + 1e-12;
  diagonal.tail<3>().array() += DAMPING * shift + 1e-12;
  return motionOf(equations.A.ldlt().solve(equations.b), center);
}

/// The motion of the source with the least squared distances from the targets (Umeyama 1991).
Eigen::Isometry3d stepToPoints(const Pairs& pairs) {
  Eigen::Matrix3Xd source(3, pairs.found()), target(3, pairs.found());
  Eigen::Index count = 0;
  for (const auto& block : pairs.blocks())
    for (int i = 0; i < SIZE; ++i) {
      if (!(block.squared[i] <= pairs.farthest())) continue;
      source.col(count) << block.x[i], block.y[i], block.z[i];
      target.col(count) =
          source.col(count) + Eigen::Vector3d(block.dx[i], block.dy[i], block.dz[i]);
      ++count;
    }
  return Eigen::Isometry3d(Eigen::umeyama(source.leftCols(count), target.leftCols(count), false));
}

/// The rotation nearest to the pose's, against drift over many small steps.
void orthonormalize(Eigen::Isometry3d& T) {
  T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
}

/// How many points of a cluster there are, and the middle of them; those that are not finite do not
/// count.
struct Extent {
  int count = 0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
};

Extent extentOf(const PlanarSurface& cluster) {
  Extent extent;
  for (const auto& block : cluster.blocks)
    for (int i = 0; i < SIZE; ++i) {
      if (std::isnan(block.x[i])) continue;
      ++extent.count;
      extent.middle += Eigen::Vector3d(block.x[i], block.y[i], block.z[i]);
    }
  extent.middle /= std::max(1, extent.count);
  return extent;
}

/// The points that are finite, so that the others do not even change the order of sums.
PlanarSurface finitePoints(const PlanarSurface& cluster) {
  Surface finite;
  for (const auto& block : cluster.blocks)
    for (int i = 0; i < SIZE; ++i) {
      if (std::isnan(block.x[i])) continue;
      finite.points.emplace_back(block.x[i], block.y[i], block.z[i]);
      finite.normals.emplace_back(block.nx[i], block.ny[i], block.nz[i]);
    }
  return finite;
}

}  // namespace

Found<Alignment> refinePose(const PlanarSurface& cluster, const NearestGrid& model,
                            const Eigen::Isometry3d& T_camera_object,
                            const RefineOptions& options) {
  checkOptions("refine", options);
  const bool to_planes = options.method == "point_to_plane";
  const Extent extent = extentOf(cluster);
  if (extent.count < static_cast<int>(cluster.size))
    return refinePose(finitePoints(cluster), model, T_camera_object, options);
  Eigen::Isometry3d T_object_camera = T_camera_object.inverse();
  Alignment alignment;
  Pairs pairs(cluster.blocks.size());
  double distance = std::max(options.start_distance, options.max_distance);
  for (; alignment.iterations < options.max_iterations && !alignment.converged;
       ++alignment.iterations) {
    pairs.find(cluster, model, T_object_camera, distance, options.trim);
    if (pairs.kept() < MIN_POINTS) break;
    const Eigen::Vector3d center = T_object_camera * extent.middle;
    const Eigen::Isometry3d step = to_planes ? stepToPlanes(pairs, center) : stepToPoints(pairs);
    T_object_camera = step * T_object_camera;
    orthonormalize(T_object_camera);

    alignment.converged = distance <= options.max_distance &&
                          angleOf(step.linear()) < options.min_rotation &&
                          (step * center - center).norm() < options.min_translation;
    distance = std::max(options.max_distance, SHRINK * distance);
  }

  pairs.find(cluster, model, T_object_camera, options.max_distance, options.trim);
  alignment.overlap = static_cast<double>(pairs.found()) / std::max(1, extent.count);
  if (pairs.found() < MIN_POINTS || alignment.overlap < options.min_overlap) {
    char reason[160];
    std::snprintf(reason, sizeof reason,
                  "%.0f %% of the points lie on the model, limit %.0f %% (%d points)",
                  100 * alignment.overlap, 100 * options.min_overlap, pairs.found());
    return Found<Alignment>::none(reason);
  }
  alignment.T_camera_object = T_object_camera.inverse();
  alignment.rms = pairs.rms();
  return alignment;
}

}  // namespace tabletop_perception
