#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

namespace tabletop_perception {

/// Exact nearest neighbours among fixed points (nanoflann). All points must be finite.
class KdTree {
 public:
  explicit KdTree(std::vector<Eigen::Vector3f> points);
  ~KdTree();
  KdTree(KdTree&&) noexcept;

  struct Neighbor {
    int index;
    float squared_distance;  ///< [m^2]
  };

  const std::vector<Eigen::Vector3f>& points() const;

  /// The nearest point; index -1 if the tree is empty.
  Neighbor nearest(const Eigen::Vector3f& p) const;

  /// The k nearest, nearest first.
  void nearest(const Eigen::Vector3f& p, int k, std::vector<Neighbor>& out) const;

  /// All points within `radius` [m], in no order.
  void within(const Eigen::Vector3f& p, double radius, std::vector<Neighbor>& out) const;

 private:
  struct Index;
  std::unique_ptr<Index> index_;
};

}  // namespace tabletop_perception
