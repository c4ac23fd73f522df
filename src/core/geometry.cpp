#include "tabletop_perception/geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>

#include <Eigen/Eigenvalues>
#include <opencv2/imgproc.hpp>

#include "simd.h"
#include "voxel_numbers.h"

namespace tabletop_perception {

Surface transformed(const Surface& source, const Eigen::Isometry3d& T_target_source) {
  const Eigen::Isometry3f T = T_target_source.cast<float>();
  Surface target;
  target.points.reserve(source.size());
  target.normals.reserve(source.size());
  for (const auto& p : source.points) target.points.push_back(T * p);
  for (const auto& n : source.normals) target.normals.push_back(T.linear() * n);
  return target;
}

Surface selected(const Surface& surface, const std::vector<int>& indices) {
  Surface part;
  part.points.reserve(indices.size());
  part.normals.reserve(indices.size());
  for (const int i : indices) {
    part.points.push_back(surface.points[i]);
    part.normals.push_back(surface.normals[i]);
  }
  return part;
}

Eigen::Vector3f meanNormal(const Surface& surface) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const auto& normal : surface.normals) sum += normal;
  return sum.norm() > 0 ? Eigen::Vector3f(sum.normalized()) : Eigen::Vector3f::UnitZ();
}

double extentOf(const std::vector<Eigen::Vector3f>& points) {
  if (points.empty()) return 0;
  const auto farthestFrom = [&](const Eigen::Vector3f& from) {
    return *std::max_element(points.begin(), points.end(), [&](const auto& a, const auto& b) {
      return (a - from).squaredNorm() < (b - from).squaredNorm();
    });
  };
  const Eigen::Vector3f end = farthestFrom(centroidOf(points));
  return (farthestFrom(end) - end).norm();
}

Eigen::Vector3f centroidOf(const std::vector<Eigen::Vector3f>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& p : points) sum += p.cast<double>();
  return (sum / static_cast<double>(points.size())).cast<float>();
}

namespace {

/// A cube and which of six directions a surface in it faces most: the two sides of a thin wall are
/// never averaged.
struct FacetKey {
  VoxelKey voxel;
  int facet;

  static FacetKey of(const Eigen::Vector3f& p, const Eigen::Vector3f& normal, double inverse_leaf) {
    Eigen::Index axis;
    normal.cwiseAbs().maxCoeff(&axis);
    return {VoxelKey::of(p, inverse_leaf), static_cast<int>(2 * axis) + (normal[axis] < 0)};
  }
  bool operator==(const FacetKey& other) const {
    return voxel == other.voxel && facet == other.facet;
  }
};

struct FacetKeyHash {
  std::size_t operator()(const FacetKey& key) const {
    return 6 * VoxelKeyHash()(key.voxel) + key.facet;
  }
};

}  // namespace

Surface downsampled(const Surface& surface, double leaf) {
  if (!(leaf > 0))
    throw std::invalid_argument("leaf must be positive, got " + std::to_string(leaf));
  Surface out;
  std::vector<int> counts;
  Numbering<FacetKey, FacetKeyHash> voxels;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const auto& p = surface.points[i];
    const int voxel = voxels.numberOf(FacetKey::of(p, surface.normals[i], 1.0 / leaf));
    if (voxel == static_cast<int>(counts.size())) {
      out.points.emplace_back(Eigen::Vector3f::Zero());
      out.normals.emplace_back(Eigen::Vector3f::Zero());
      counts.push_back(0);
    }
    out.points[voxel] += p;
    out.normals[voxel] += surface.normals[i];
    ++counts[voxel];
  }
  for (std::size_t i = 0; i < counts.size(); ++i) {
    out.points[i] /= static_cast<float>(counts[i]);
    out.normals[i].normalize();
  }
  return out;
}

namespace {

/// Columns: the principal axes, largest extent of the points first.
Eigen::Matrix3d principalAxes(const std::vector<Eigen::Vector3f>& points) {
  const Eigen::Vector3d mean = centroidOf(points).cast<double>();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& p : points) {
    const Eigen::Vector3d d = p.cast<double>() - mean;
    covariance += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  return solver.eigenvectors().rowwise().reverse();
}

/// Points as three arrays, from an origin near them, where single precision is enough [m].
struct PlanarPoints {
  Eigen::Vector3f origin;
  std::vector<float> x, y, z;

  explicit PlanarPoints(const std::vector<Eigen::Vector3f>& points)
      : origin(points.front()), x(points.size()), y(points.size()), z(points.size()) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      x[i] = points[i].x() - origin.x();
      y[i] = points[i].y() - origin.y();
      z[i] = points[i].z() - origin.z();
    }
  }
};

TABLETOP_SIMD_CLONES
void placesAlong(const float* x, const float* y, const float* z, std::size_t count,
                 const float* axis, float* places) {
  for (std::size_t i = 0; i < count; ++i)
    places[i] = axis[0] * x[i] + (axis[1] * y[i] + axis[2] * z[i]);
}

/// Where the points lie along an axis, from their origin.
std::vector<float> placesAlong(const PlanarPoints& points, const Eigen::Vector3d& axis) {
  const Eigen::Vector3f direction = axis.cast<float>();
  std::vector<float> places(points.x.size());
  placesAlong(points.x.data(), points.y.data(), points.z.data(), places.size(), direction.data(),
              places.data());
  return places;
}

constexpr std::size_t LANES = 8;  // points that a kernel takes at once

/// A point of the greatest a x + b y, of at least one.
TABLETOP_SIMD_CLONES
std::size_t farthestAlong(const float* x, const float* y, std::size_t count, float a, float b) {
  float most[LANES];
  int where[LANES] = {};
  for (std::size_t l = 0; l < LANES; ++l) most[l] = a * x[0] + b * y[0];
  const std::size_t whole = count / LANES * LANES;
  for (std::size_t i = 0; i < whole; i += LANES)
    for (std::size_t l = 0; l < LANES; ++l) {
      const float value = a * x[i + l] + b * y[i + l];
      const bool farther = value > most[l];
      most[l] = farther ? value : most[l];
      where[l] = farther ? static_cast<int>(i + l) : where[l];
    }
  const std::size_t lane = std::max_element(most, most + LANES) - most;
  std::size_t farthest = where[lane];
  for (std::size_t i = whole; i < count; ++i)
    if (a * x[i] + b * y[i] > a * x[farthest] + b * y[farthest]) farthest = i;
  return farthest;
}

/// Takes the marks off the points that do not lie to the left of the way from one point to another.
TABLETOP_SIMD_CLONES
void keepLeftOf(const float* x, const float* y, std::size_t count, cv::Point2f from, cv::Point2f to,
                std::uint8_t* inside) {
  const float a = to.x - from.x, b = to.y - from.y;
  for (std::size_t i = 0; i < count; ++i)
    inside[i] &= a * (y[i] - from.y) - b * (x[i] - from.x) > 0;
}

/// The points without those inside the octagon of the outermost ones (Akl & Toussaint 1978), which
/// is most of them: a hull is made by sorting all that it is given.
std::vector<cv::Point2f> outerPoints(const std::vector<float>& x, const std::vector<float>& y) {
  const auto farthest = [&](float a, float b) {
    const std::size_t i = farthestAlong(x.data(), y.data(), x.size(), a, b);
    return cv::Point2f(x[i], y[i]);
  };
  const std::array<cv::Point2f, 8> corners = {// counter-clockwise
                                              farthest(1, 0),  farthest(1, 1),  farthest(0, 1),
                                              farthest(-1, 1), farthest(-1, 0), farthest(-1, -1),
                                              farthest(0, -1), farthest(1, -1)};
  std::vector<std::uint8_t> inside(x.size(), 1);
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const cv::Point2f from = corners[k], to = corners[(k + 1) % corners.size()];
    if (from != to) keepLeftOf(x.data(), y.data(), x.size(), from, to, inside.data());
  }
  std::vector<cv::Point2f> outer(corners.begin(), corners.end());
  for (std::size_t i = 0; i < x.size(); ++i)
    if (!inside[i]) outer.emplace_back(x[i], y[i]);
  return outer;
}

/// Columns: the sides of the least rectangle about the points as seen along `up`, then `up`.
/// Principal axes would be drawn aside wherever the camera sees more of one side than of the other.
Eigen::Matrix3d uprightAxes(const PlanarPoints& points, const Eigen::Vector3d& up) {
  const Eigen::Vector3d u = up.unitOrthogonal(), v = up.cross(u);
  std::array<cv::Point2f, 4> corners;
  cv::minAreaRect(outerPoints(placesAlong(points, u), placesAlong(points, v)))
      .points(corners.data());
  const cv::Point2f a = corners[1] - corners[0], b = corners[2] - corners[1];
  const cv::Point2f side = cv::norm(a) > cv::norm(b) ? a : b;
  const Eigen::Vector3d along = side.x * u + side.y * v;
  Eigen::Matrix3d axes;
  axes.col(0) = along.norm() > 0 ? Eigen::Vector3d(along.normalized()) : u;
  axes.col(2) = up;
  axes.col(1) = up.cross(axes.col(0));
  return axes;
}

}  // namespace

Box boxAround(const std::vector<Eigen::Vector3f>& points,
              const std::optional<Eigen::Vector3d>& up) {
  Box box;
  if (points.empty()) return box;
  const PlanarPoints planar(points);
  const Eigen::Matrix3d axes = up ? uprightAxes(planar, *up) : principalAxes(points);

  Eigen::Vector3d low, high;
  for (int axis = 0; axis < 3; ++axis) {
    const auto places = placesAlong(planar, axes.col(axis));
    low[axis] = places[farthestAlong(places.data(), places.data(), places.size(), -1, 0)];
    high[axis] = places[farthestAlong(places.data(), places.data(), places.size(), 1, 0)];
  }
  const Eigen::Vector3d center = planar.origin.cast<double>() + axes * (low + high) / 2;
  const Eigen::Vector3d size = high - low;

  std::array<int, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return size[a] > size[b]; });
  Eigen::Matrix3d sorted;
  for (int i = 0; i < 3; ++i) {
    sorted.col(i) = axes.col(order[i]);
    box.size[i] = size[order[i]];
  }
  if (sorted.determinant() < 0) sorted.col(2) *= -1;
  box.T_camera_box.linear() = sorted;
  box.T_camera_box.translation() = center;
  return box;
}

Eigen::Matrix3d rotationBetween(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

double angleOf(const Eigen::Matrix3d& rotation) { return Eigen::AngleAxisd(rotation).angle(); }

}  // namespace tabletop_perception
