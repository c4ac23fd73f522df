#include "stock_recognition.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <pcl/common/centroid.h>
#include <pcl/features/normal_3d.h>
#include <pcl/features/vfh.h>
#include <pcl/registration/icp.h>
#include <pcl/search/kdtree.h>
#include <flann/flann.hpp>

namespace tabletop_perception::tools::stock {
namespace {

using Point = pcl::PointNormal;
using Tree = pcl::search::KdTree<Point>;

/// Counts, and stops at nothing but the number of iterations.
template <typename Icp>
class AllIterations : public Icp {
 public:
  AllIterations() {
    this->setTransformationEpsilon(0);
    this->getConvergeCriteria()->setAbsoluteMSE(0);
  }
  int iterations() const { return this->nr_iterations_; }
};

}  // namespace

Oriented::Ptr orientedPoints(const Surface& surface) {
  const Oriented::Ptr points(new Oriented);
  for (std::size_t i = 0; i < surface.size(); ++i) {
    Point point;
    point.getVector3fMap() = surface.points[i];
    point.getNormalVector3fMap() = surface.normals[i];
    points->push_back(point);
  }
  return points;
}

Oriented::Ptr withNormals(const Points::ConstPtr& points, double radius) {
  pcl::NormalEstimation<Points::PointType, Point> estimation;
  estimation.setInputCloud(points);
  estimation.setSearchMethod(
      pcl::search::KdTree<Points::PointType>::Ptr(new pcl::search::KdTree<Points::PointType>));
  estimation.setRadiusSearch(radius);
  estimation.setViewPoint(0, 0, 0);
  Oriented all;
  estimation.compute(all);
  const Oriented::Ptr oriented(new Oriented);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!std::isfinite(all[i].normal_x)) continue;
    all[i].getVector3fMap() = (*points)[i].getVector3fMap();
    oriented->push_back(all[i]);
  }
  return oriented;
}

Eigen::Vector3f centroidOf(const Oriented::ConstPtr& points) {
  Eigen::Vector4f centroid;
  pcl::compute3DCentroid(*points, centroid);
  return centroid.head<3>();
}

std::array<float, VFH_SIZE> vfh(const Oriented::ConstPtr& points) {
  pcl::VFHEstimation<Point, Point, pcl::VFHSignature308> estimation;
  estimation.setInputCloud(points);
  estimation.setInputNormals(points);
  estimation.setSearchMethod(Tree::Ptr(new Tree));
  pcl::PointCloud<pcl::VFHSignature308> signature;
  estimation.compute(signature);
  std::array<float, VFH_SIZE> values;
  std::copy(std::begin(signature[0].histogram), std::end(signature[0].histogram), values.begin());
  return values;
}

struct RegistrationTarget::Data {
  Oriented::Ptr points;
  Tree::Ptr tree;
};

RegistrationTarget::RegistrationTarget(const Surface& surface) {
  const auto data = std::make_shared<Data>();
  data->points = orientedPoints(surface);
  data->tree.reset(new Tree);
  data->tree->setInputCloud(data->points);
  data_ = data;
}

namespace {

template <typename Icp>
Registration alignBy(const Oriented::ConstPtr& source, const Oriented::Ptr& target,
                     const Tree::Ptr& tree, const Eigen::Isometry3f& T_target_source,
                     double max_distance, int iterations) {
  AllIterations<Icp> icp;
  icp.setSearchMethodTarget(tree, true);
  icp.setInputTarget(target);
  icp.setInputSource(source);
  icp.setMaxCorrespondenceDistance(max_distance);
  icp.setMaximumIterations(iterations);
  Oriented moved;
  icp.align(moved, T_target_source.matrix());
  return {Eigen::Isometry3f(icp.getFinalTransformation()), icp.iterations()};
}

}  // namespace

Registration RegistrationTarget::align(const Oriented::ConstPtr& source,
                                       const Eigen::Isometry3f& T_target_source,
                                       double max_distance, int iterations) const {
  return alignBy<pcl::IterativeClosestPointWithNormals<Point, Point>>(
      source, data_->points, data_->tree, T_target_source, max_distance, iterations);
}

Registration RegistrationTarget::alignToPoints(const Oriented::ConstPtr& source,
                                               const Eigen::Isometry3f& T_target_source,
                                               double max_distance, int iterations) const {
  return alignBy<pcl::IterativeClosestPoint<Point, Point>>(
      source, data_->points, data_->tree, T_target_source, max_distance, iterations);
}

struct LinearSearch::Data {
  std::vector<float> values;
  std::size_t dimension;
  std::unique_ptr<flann::Index<flann::ChiSquareDistance<float>>> index;
};

LinearSearch::LinearSearch(const std::vector<float>& values, int dimension) {
  const auto data = std::make_shared<Data>();
  data->values = values;
  data->dimension = static_cast<std::size_t>(dimension);
  const flann::Matrix<float> rows(data->values.data(), values.size() / data->dimension,
                                  data->dimension);
  data->index = std::make_unique<flann::Index<flann::ChiSquareDistance<float>>>(
      rows, flann::LinearIndexParams());
  data->index->buildIndex();
  data_ = data;
}

std::vector<int> LinearSearch::nearest(const std::vector<float>& query, int count) const {
  std::vector<float> values = query, distances(count);
  std::vector<int> rows(count);
  flann::Matrix<int> row_matrix(rows.data(), 1, rows.size());
  flann::Matrix<float> distance_matrix(distances.data(), 1, distances.size());
  data_->index->knnSearch(flann::Matrix<float>(values.data(), 1, data_->dimension), row_matrix,
                          distance_matrix, static_cast<std::size_t>(count), flann::SearchParams());
  return rows;
}

}  // namespace tabletop_perception::tools::stock
