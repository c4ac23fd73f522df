#pragma once

#include <array>
#include <memory>
#include <vector>

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <Eigen/Geometry>

#include "stock_pcl.h"
#include "tabletop_perception/descriptor.h"
#include "tabletop_perception/geometry.h"

/// Stock PCL's counterparts of the stages of recognition, for `tabletop benchmark`. As in
/// stock_pcl.h, every call builds its PCL objects anew.
namespace tabletop_perception::tools::stock {

using Oriented = pcl::PointCloud<pcl::PointNormal>;

Oriented::Ptr orientedPoints(const Surface& surface);

/// NormalEstimation of finite points within `radius` [m], seen from the origin; those without a
/// normal left out.
Oriented::Ptr withNormals(const Points::ConstPtr& points, double radius);

Eigen::Vector3f centroidOf(const Oriented::ConstPtr& points);

/// VFHEstimation as it is set up by default, seen from the origin.
std::array<float, VFH_SIZE> vfh(const Oriented::ConstPtr& points);

/// Where ICP ended.
struct Registration {
  Eigen::Isometry3f T_target_source = Eigen::Isometry3f::Identity();
  int iterations = 0;
};

/// A cloud that others are laid on, its kd-tree made beforehand.
class RegistrationTarget {
 public:
  explicit RegistrationTarget(const Surface& surface);

  /// IterativeClosestPointWithNormals: point to plane, all of the iterations, correspondences up
  /// to `max_distance` [m].
  Registration align(const Oriented::ConstPtr& source, const Eigen::Isometry3f& T_target_source,
                     double max_distance, int iterations) const;

  /// IterativeClosestPoint: point to point, otherwise the same.
  Registration alignToPoints(const Oriented::ConstPtr& source,
                             const Eigen::Isometry3f& T_target_source, double max_distance,
                             int iterations) const;

 private:
  struct Data;
  std::shared_ptr<const Data> data_;
};

/// Exact search of rows of `dimension` numbers by FLANN's linear index, chi-square distance.
class LinearSearch {
 public:
  LinearSearch(const std::vector<float>& values, int dimension);

  /// The rows nearest to `query`, nearest first.
  std::vector<int> nearest(const std::vector<float>& query, int count) const;

 private:
  struct Data;
  std::shared_ptr<const Data> data_;
};

}  // namespace tabletop_perception::tools::stock
