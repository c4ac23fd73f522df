#include "integral_normals.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Eigenvalues>

namespace tabletop_perception {
namespace {

constexpr float NONE = std::numeric_limits<float>::quiet_NaN();
constexpr int MAX_RADIUS = 30;  // of a square [pixels]

std::vector<float> rangesOf(const Cloud& cloud) {
  std::vector<float> ranges(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    ranges[i] =
        std::sqrt(cloud.x[i] * cloud.x[i] + cloud.y[i] * cloud.y[i] + cloud.z[i] * cloud.z[i]);
  return ranges;
}

/// How far each pixel is from the next at an edge, counted along rows, columns and diagonals: the
/// square of half side r about a pixel holds no edge exactly if this is more than r. Edges are the
/// pixels outside the image, those without a point, and both sides of a jump in range. (The paper
/// takes the Euclidean distance over the root of two, which is safe but less.)
class EdgeDistances {
 public:
  EdgeDistances(const Cloud& cloud, const std::vector<float>& ranges, float max_change)
      : width_(cloud.width + 2),
        distances_(static_cast<std::size_t>(width_) * (cloud.height + 2), 0) {
    markEdges(cloud, ranges, max_change);
    for (int v = 0; v < cloud.height; ++v) {
      limitByRow(v, -1);
      for (int u = 0; u < cloud.width; ++u) limit(at(v, u), at(v, u - 1));
    }
    for (int v = cloud.height - 1; v >= 0; --v) {
      limitByRow(v, 1);
      for (int u = cloud.width - 1; u >= 0; --u) limit(at(v, u), at(v, u + 1));
    }
  }

  int operator()(int v, int u) const { return distances_[at(v, u)]; }

 private:
  /// With a border of edges about the image.
  std::size_t at(int v, int u) const { return static_cast<std::size_t>(v + 1) * width_ + u + 1; }

  void markEdges(const Cloud& cloud, const std::vector<float>& ranges, float max_change) {
    const auto markJump = [&](int v, int u, int dv, int du) {
      const float range = ranges[v * cloud.width + u];
      const float other = ranges[(v - dv) * cloud.width + u - du];
      if (std::abs(range - other) > max_change * range)  // not for NaN
        distances_[at(v, u)] = distances_[at(v - dv, u - du)] = 0;
    };
    for (int v = 0; v < cloud.height; ++v) {
      for (int u = 0; u < cloud.width; ++u) {
        distances_[at(v, u)] = cloud.valid(v * cloud.width + u) ? MAX_RADIUS + 1 : 0;
        if (u > 0) markJump(v, u, 0, 1);
        if (v > 0) markJump(v, u, 1, 0);
      }
    }
  }

  void limit(std::size_t i, std::size_t by) {
    distances_[i] = std::min<std::uint8_t>(distances_[i], distances_[by] + 1);
  }

  void limitByRow(int v, int step) {
    const int width = width_ - 2;
    std::uint8_t* const row = distances_.data() + at(v, 0);
    const std::uint8_t* const next = distances_.data() + at(v + step, 0);
    for (int u = 0; u < width; ++u) {
      const std::uint8_t least = std::min(std::min(next[u - 1], next[u]), next[u + 1]);
      row[u] = std::min<std::uint8_t>(row[u], least + 1);
    }
  }

  int width_;
  std::vector<std::uint8_t> distances_;
};

/// Sums of K values per pixel over rectangles, in four look-ups.
template <int K>
class IntegralImage {
 public:
  using Values = Eigen::Matrix<double, K, 1>;

  /// `valuesAt(v, u)`: of a pixel, finite.
  template <typename ValuesAt>
  IntegralImage(int width, int height, ValuesAt valuesAt)
      : width_(width + 1), sums_(static_cast<std::size_t>(width + 1) * (height + 1)) {
    std::fill(sums_.begin(), sums_.begin() + width_, Values::Zero());
    for (int v = 0; v < height; ++v) {
      Values row = Values::Zero();
      sums_[at(v + 1, 0)] = row;
      for (int u = 0; u < width; ++u) {
        row += valuesAt(v, u);
        sums_[at(v + 1, u + 1)] = sums_[at(v, u + 1)] + row;
      }
    }
  }

  /// The mean over the square of half side `r` about a pixel.
  Values meanAbout(int v, int u, int r) const {
    const int count = (2 * r + 1) * (2 * r + 1);
    return (sums_[at(v + r + 1, u + r + 1)] - sums_[at(v - r, u + r + 1)] -
            sums_[at(v + r + 1, u - r)] + sums_[at(v - r, u - r)]) /
           count;
  }

 private:
  std::size_t at(int v, int u) const { return static_cast<std::size_t>(v) * width_ + u; }

  int width_;
  std::vector<Values> sums_;
};

struct Normal {
  Eigen::Vector3f direction;  ///< of any length and sign
  float curvature = NONE;
};

/// Mean ranges over squares that touch the middle pixel on four sides, each put on the ray of its
/// own middle: two lines on the surface. One integral image.
class AverageDepthChange {
 public:
  AverageDepthChange(const Cloud& cloud, const std::vector<float>& ranges)
      : cloud_(cloud), ranges_(ranges), sums_(cloud.width, cloud.height, [&](int v, int u) {
          const float range = ranges[v * cloud.width + u];
          return Eigen::Matrix<double, 1, 1>(std::isnan(range) ? 0.0 : range);
        }) {}

  Normal operator()(int v, int u, int r) const {
    const int half = (r - 1) / 2, offset = half + 1;
    const Eigen::Vector3f along_row = at(v, u + offset, half) - at(v, u - offset, half);
    const Eigen::Vector3f along_column = at(v + offset, u, half) - at(v - offset, u, half);
    return {along_row.cross(along_column)};
  }

 private:
  Eigen::Vector3f at(int v, int u, int half) const {
    const int i = v * cloud_.width + u;
    return cloud_.point(i) * (static_cast<float>(sums_.meanAbout(v, u, half)[0]) / ranges_[i]);
  }

  const Cloud& cloud_;
  const std::vector<float>& ranges_;
  IntegralImage<1> sums_;
};

/// Mean differences between the points right and left, and below and above, of each pixel. Six
/// integral images.
class Average3dGradient {
 public:
  explicit Average3dGradient(const Cloud& cloud)
      : sums_(cloud.width, cloud.height, [&](int v, int u) {
          Eigen::Matrix<double, 6, 1> gradients;
          gradients << difference(cloud, v, u, 0, 1), difference(cloud, v, u, 1, 0);
          return gradients;
        }) {}

  Normal operator()(int v, int u, int r) const {
    const Eigen::Matrix<double, 6, 1> mean = sums_.meanAbout(v, u, r - 1);
    const Eigen::Vector3d along_row = mean.head<3>(), along_column = mean.tail<3>();
    return {along_row.cross(along_column).cast<float>()};
  }

 private:
  /// Zero where one of the two has no point: such a pixel is in no square.
  static Eigen::Vector3d difference(const Cloud& cloud, int v, int u, int dv, int du) {
    if (v < dv || v + dv >= cloud.height || u < du || u + du >= cloud.width)
      return Eigen::Vector3d::Zero();
    const int i = v * cloud.width + u, step = dv * cloud.width + du;
    if (!cloud.valid(i - step) || !cloud.valid(i + step)) return Eigen::Vector3d::Zero();
    return (cloud.point(i + step) - cloud.point(i - step)).cast<double>();
  }

  IntegralImage<6> sums_;
};

/// The covariance of the points in the square. Nine integral images.
class Covariance {
 public:
  explicit Covariance(const Cloud& cloud)
      : sums_(cloud.width, cloud.height, [&](int v, int u) {
          Eigen::Matrix<double, 9, 1> moments = Eigen::Matrix<double, 9, 1>::Zero();
          const int i = v * cloud.width + u;
          if (!cloud.valid(i)) return moments;
          const Eigen::Vector3d p = cloud.point(i).cast<double>();
          moments << p, p.x() * p, p.y() * p.y(), p.y() * p.z(), p.z() * p.z();
          return moments;
        }) {}

  Normal operator()(int v, int u, int r) const {
    const Eigen::Matrix<double, 9, 1> m = sums_.meanAbout(v, u, r);
    const Eigen::Vector3d mean = m.head<3>();
    Eigen::Matrix3d products;
    products << m[3], m[4], m[5], m[4], m[6], m[7], m[5], m[7], m[8];
    const Eigen::Matrix3d covariance = products - mean * mean.transpose();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
    solver.computeDirect(covariance.cast<float>());
    const Eigen::Vector3f values = solver.eigenvalues();
    if (!(values[1] > 1e-3f * values[2])) return {Eigen::Vector3f::Zero()};  // a line
    return {solver.eigenvectors().col(0), std::max(0.0f, values[0]) / values.sum()};
  }

 private:
  IntegralImage<9> sums_;
};

template <typename Method>
Normals computeWith(const Method& method, const Cloud& cloud, const std::vector<float>& ranges,
                    const Eigen::Vector3f& viewpoint, const NormalsOptions& options) {
  const std::vector<float> none(cloud.size(), NONE);
  Normals normals{none, none, none, none};
  const EdgeDistances distances(cloud, ranges, static_cast<float>(options.depth_change));
  const auto radius_at_1m = static_cast<float>(options.smoothing / 2);
  for (int v = 0; v < cloud.height; ++v)
    for (int u = 0; u < cloud.width; ++u) {
      const int i = v * cloud.width + u;
      const int clear = distances(v, u) - 1;  // half side of the largest square without an edge
      if (clear < 1) continue;
      const float wanted = std::min<float>(radius_at_1m * ranges[i], MAX_RADIUS);
      const int radius = std::clamp(static_cast<int>(wanted + 0.5f), 1, clear);
      const Normal normal = method(v, u, radius);
      const float length = normal.direction.norm();
      if (!(length > 0)) continue;
      const float sign = normal.direction.dot(viewpoint - cloud.point(i)) < 0 ? -1.0f : 1.0f;
      const Eigen::Vector3f unit = normal.direction * (sign / length);
      normals.x[i] = unit.x();
      normals.y[i] = unit.y();
      normals.z[i] = unit.z();
      normals.curvature[i] = normal.curvature;
    }
  return normals;
}

}  // namespace

Normals computeIntegralNormals(const Cloud& cloud, const Eigen::Vector3f& viewpoint,
                               const NormalsOptions& options) {
  const auto ranges = rangesOf(cloud);
  if (options.method == "average_depth_change")
    return computeWith(AverageDepthChange(cloud, ranges), cloud, ranges, viewpoint, options);
  if (options.method == "average_3d_gradient")
    return computeWith(Average3dGradient(cloud), cloud, ranges, viewpoint, options);
  return computeWith(Covariance(cloud), cloud, ranges, viewpoint, options);
}

}  // namespace tabletop_perception
