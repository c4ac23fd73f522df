#include "stock_pcl.h"

#include <cstdint>
#include <set>

#include <pcl/conversions.h>
#include <pcl/features/integral_image_normal.h>
#include <pcl/filters/extract_indices.h>
#include <pcl/filters/passthrough.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/euclidean_cluster_comparator.h>
#include <pcl/segmentation/extract_clusters.h>
#include <pcl/segmentation/organized_connected_component_segmentation.h>
#include <pcl/segmentation/sac_segmentation.h>

#ifndef TABLETOP_PCL_BUILD  // the build defines it where this file is compiled once more
#define TABLETOP_PCL_BUILD packagedPcl
#endif

namespace tabletop_perception::tools::stock {
namespace {

using Point = Points::PointType;

Points::Ptr withoutPoints(const Points::ConstPtr& points, const pcl::PointIndices& indices) {
  pcl::ExtractIndices<Point> extract;
  extract.setInputCloud(points);
  extract.setIndices(pcl::PointIndices::ConstPtr(new pcl::PointIndices(indices)));
  extract.setNegative(true);
  const Points::Ptr rest(new Points);
  extract.filter(*rest);
  return rest;
}

Points::Ptr crop(const pcl::PCLPointCloud2& message, const Forward& forward, bool organized) {
  const Points::Ptr points(new Points), cropped(new Points);
  pcl::fromPCLPointCloud2(message, *points);
  pcl::PassThrough<Point> pass;
  pass.setInputCloud(points);
  pass.setFilterFieldName(forward.axis);
  pass.setFilterLimits(forward.positive ? MIN_DEPTH : -MAX_DEPTH,
                       forward.positive ? MAX_DEPTH : -MIN_DEPTH);
  pass.setKeepOrganized(organized);
  pass.filter(*cropped);
  return cropped;
}

Points::Ptr voxelGrid(const Points::ConstPtr& points) {
  pcl::VoxelGrid<Point> grid;
  grid.setInputCloud(points);
  grid.setLeafSize(LEAF, LEAF, LEAF);
  const Points::Ptr voxels(new Points);
  grid.filter(*voxels);
  return voxels;
}

pcl::PointCloud<pcl::Normal>::Ptr normals(const Points::ConstPtr& points,
                                          const std::string& method) {
  using Estimation = pcl::IntegralImageNormalEstimation<Point, pcl::Normal>;
  Estimation estimation;
  estimation.setNormalEstimationMethod(
      method == "average_depth_change"  ? Estimation::AVERAGE_DEPTH_CHANGE
      : method == "average_3d_gradient" ? Estimation::AVERAGE_3D_GRADIENT
                                        : Estimation::COVARIANCE_MATRIX);
  estimation.setMaxDepthChangeFactor(NORMAL_DEPTH_CHANGE);
  estimation.setNormalSmoothingSize(NORMAL_SMOOTHING_SIZE);
  estimation.setInputCloud(points);
  const pcl::PointCloud<pcl::Normal>::Ptr normals(new pcl::PointCloud<pcl::Normal>);
  estimation.compute(*normals);
  return normals;
}

pcl::PointIndices planeInliers(const Points::ConstPtr& points) {
  pcl::SACSegmentation<Point> segmentation;
  segmentation.setOptimizeCoefficients(true);
  segmentation.setModelType(pcl::SACMODEL_PLANE);
  segmentation.setMethodType(pcl::SAC_RANSAC);
  segmentation.setMaxIterations(100);
  segmentation.setDistanceThreshold(PLANE_DISTANCE);
  segmentation.setInputCloud(points);
  pcl::PointIndices inliers;
  pcl::ModelCoefficients coefficients;
  segmentation.segment(inliers, coefficients);
  return inliers;
}

std::vector<pcl::PointIndices> euclideanClusters(const Points::ConstPtr& points) {
  std::vector<pcl::PointIndices> clusters;
  if (points->empty()) return clusters;
  const pcl::search::KdTree<Point>::Ptr tree(new pcl::search::KdTree<Point>);
  tree->setInputCloud(points);
  pcl::EuclideanClusterExtraction<Point> extraction;
  extraction.setClusterTolerance(CLUSTER_TOLERANCE);
  extraction.setMinClusterSize(MIN_CLUSTER);
  extraction.setMaxClusterSize(MAX_CLUSTER);
  extraction.setSearchMethod(tree);
  extraction.setInputCloud(points);
  extraction.extract(clusters);
  return clusters;
}

std::vector<pcl::PointIndices> organizedClusters(const Points::ConstPtr& points,
                                                 const Labels::Ptr& labels) {
  using Comparator = pcl::EuclideanClusterComparator<Point, pcl::Label>;
  const Comparator::Ptr comparator(new Comparator);
  comparator->setInputCloud(points);
  comparator->setLabels(labels);
  // It takes them the wrong way round: labels that are not in the set are excluded.
  comparator->setExcludeLabels(Comparator::ExcludeLabelSetPtr(new std::set<std::uint32_t>{1}));
  comparator->setDistanceThreshold(static_cast<float>(CLUSTER_TOLERANCE), false);
  pcl::OrganizedConnectedComponentSegmentation<Point, pcl::Label> segmentation(comparator);
  segmentation.setInputCloud(points);
  Labels components;  // a fresh one each time: a used one makes it crash
  std::vector<pcl::PointIndices> clusters;
  segmentation.segment(components, clusters);
  return clusters;
}

std::vector<pcl::PointIndices> frontEnd(const pcl::PCLPointCloud2& message,
                                        const Forward& forward) {
  const auto voxels = voxelGrid(crop(message, forward, false));
  return euclideanClusters(withoutPoints(voxels, planeInliers(voxels)));
}

}  // namespace

__attribute__((visibility("default"))) const Build& TABLETOP_PCL_BUILD() {
  static const Build BUILD = {
      crop, voxelGrid, normals, planeInliers, euclideanClusters, organizedClusters, frontEnd};
  return BUILD;
}

}  // namespace tabletop_perception::tools::stock
