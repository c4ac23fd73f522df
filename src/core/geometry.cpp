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

/// The points without those inside the octagon of the outermost ones (Akl & Toussaint 1978), which
/// is most of them: a hull is made by sorting all that it is given.
std::vector<cv::Point2f> outerPoints(const std::vector<cv::Point2f>& points) {
  // Along x, x + y, y, y - x and back: counter-clockwise.
  std::array<cv::Point2f, 8> corners;
  corners.fill(points.front());
  for (const auto& p : points) {
    if (p.x > corners[0].x) corners[0] = p;
    if (p.x + p.y > corners[1].x + corners[1].y) corners[1] = p;
    if (p.y > corners[2].y) corners[2] = p;
    if (p.y - p.x > corners[3].y - corners[3].x) corners[3] = p;
    if (p.x < corners[4].x) corners[4] = p;
    if (p.x + p.y < corners[5].x + corners[5].y) corners[5] = p;
    if (p.y < corners[6].y) corners[6] = p;
    if (p.y - p.x < corners[7].y - corners[7].x) corners[7] = p;
  }
  const auto inside = [&](const cv::Point2f& p) {
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const cv::Point2f from = corners[k], to = corners[(k + 1) % corners.size()];
      if (from != to && (to - from).cross(p - from) <= 0) return false;
    }
    return true;
  };
  std::vector<cv::Point2f> outer;
  std::copy_if(points.begin(), points.end(), std::back_inserter(outer),
               [&](const cv::Point2f& p) { return !inside(p); });
  return outer.empty() ? points : outer;  // all are one
}

/// Columns: the sides of the least rectangle about the points as seen along `up`, then `up`.
/// Principal axes would be drawn aside wherever the camera sees more of one side than of the other.
Eigen::Matrix3d uprightAxes(const std::vector<Eigen::Vector3f>& points, const Eigen::Vector3d& up) {
  const Eigen::Vector3d u = up.unitOrthogonal(), v = up.cross(u);
  const Eigen::Vector3d origin = points.front().cast<double>();  // near: OpenCV works in floats
  std::vector<cv::Point2f> flat;
  flat.reserve(points.size());
  for (const auto& p : points) {
    const Eigen::Vector3d d = p.cast<double>() - origin;
    flat.emplace_back(static_cast<float>(u.dot(d)), static_cast<float>(v.dot(d)));
  }
  std::array<cv::Point2f, 4> corners;
  cv::minAreaRect(outerPoints(flat)).points(corners.data());
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
  Eigen::Matrix3d axes = up ? uprightAxes(points, *up) : principalAxes(points);

  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector3d high = -low;
  for (const auto& p : points) {
    const Eigen::Vector3d q = axes.transpose() * p.cast<double>();
    low = low.cwiseMin(q);
    high = high.cwiseMax(q);
  }
  const Eigen::Vector3d center = axes * (low + high) / 2;
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
