#pragma once

#include <vector>

#include <Eigen/Core>

namespace tabletop_perception {

/// Sums over the points of a neighbourhood, relative to its middle so that float noise stays small.
struct Moments {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  Eigen::Matrix3f products = Eigen::Matrix3f::Zero();
  int count = 0;
};

/// Neighbours within one fixed radius among fixed points: the points sorted into cubes of the
/// radius, so that those about a point lie in nine runs. For sampled surfaces several times faster
/// than a kd-tree. All points must be finite.
class RadiusGrid {
 public:
  /// `radius`: positive [m].
  RadiusGrid(const std::vector<Eigen::Vector3f>& points, double radius);

  /// Of the points within the radius of `p`, which must be one of the points.
  Moments momentsAbout(const Eigen::Vector3f& p) const;

  /// Appends the indices of the points within the radius of `p`, which must be one of the points.
  void appendWithin(const Eigen::Vector3f& p, std::vector<int>& indices) const;

 private:
  Eigen::Array3i cubeOf(const Eigen::Vector3f& p) const;

  /// Calls visit(first, end) for the runs of sorted points that hold what is near `p`.
  template <typename Visit>
  void visitRuns(const Eigen::Vector3f& p, Visit visit) const;

  float squared_radius_;
  Eigen::Vector3f low_ = Eigen::Vector3f::Zero();
  float inverse_side_ = 0;
  Eigen::Array3i size_ = Eigen::Array3i::Ones();
  std::vector<int> begins_;       // of each cube among the sorted points, and the end
  std::vector<float> x_, y_, z_;  // sorted, and NaN beyond their end
  std::vector<int> indices_;      // of the sorted points
};

}  // namespace tabletop_perception
