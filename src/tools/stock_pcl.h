#pragma once

#include <string>
#include <vector>

#include <pcl/PCLPointCloud2.h>
#include <pcl/PointIndices.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "tabletop_perception/cloud.h"

/// Stock PCL's way through the front end, set up as its tutorials do: what `tabletop benchmark`
/// compares with. Its algorithm headers, which are slow to compile, stay behind this one. Every
/// call builds its PCL objects anew, as their answers may depend on what they did before.
namespace tabletop_perception::tools::stock {

using Points = pcl::PointCloud<pcl::PointXYZRGB>;
using Labels = pcl::PointCloud<pcl::Label>;

/// What the tutorials set; lengths in metres.
constexpr float MIN_DEPTH = 0.1f, MAX_DEPTH = 2.0f;  ///< of PassThrough
constexpr float LEAF = 0.005f;                       ///< of VoxelGrid
constexpr double PLANE_DISTANCE = 0.01;              ///< of SACSegmentation
constexpr double CLUSTER_TOLERANCE = 0.02;           ///< of both ways to clusters
constexpr int MIN_CLUSTER = 100;                     ///< points
constexpr int MAX_CLUSTER = 25000;                   ///< points
constexpr float NORMAL_DEPTH_CHANGE = 0.02f;         ///< of IntegralImageNormalEstimation
constexpr float NORMAL_SMOOTHING_SIZE = 10.0f;       ///< of IntegralImageNormalEstimation [pixels]

/// A cloud as a camera driver publishes it: 32 bytes a point, those of PointXYZRGB.
pcl::PCLPointCloud2 packedMessage(const Cloud& cloud);

/// The same points in PCL's type.
Points::Ptr pointsOf(const Cloud& cloud);

/// Keeps PCL from complaining on stderr, for which it takes time.
void silence();

/// The axis of a cloud's frame along which the camera looks: "z" in an optical frame.
struct Forward {
  std::string axis;
  bool positive;  ///< in the axis's own direction
};
Forward forwardOf(const Cloud& cloud);

/// PointCloud2 bytes to points within MIN_DEPTH and MAX_DEPTH; the others NaN if `organized`, else
/// left out.
Points::Ptr crop(const pcl::PCLPointCloud2& message, const Forward& forward, bool organized);

Points::Ptr voxelGrid(const Points::ConstPtr& points);

/// By integral images, with one of the methods that NormalsOptions names; NaN where there is none.
/// The cloud must be organised.
pcl::PointCloud<pcl::Normal> normals(const Points::ConstPtr& points,
                                     const std::string& method = "covariance");

/// Points on the largest plane.
pcl::PointIndices planeInliers(const Points::ConstPtr& points);

/// EuclideanClusterExtraction with a kd-tree. The points must be finite.
std::vector<pcl::PointIndices> euclideanClusters(const Points::ConstPtr& points);

/// OrganizedConnectedComponentSegmentation with a EuclideanClusterComparator of the points whose
/// label is 1.
std::vector<pcl::PointIndices> organizedClusters(const Points::ConstPtr& points,
                                                 const Labels::Ptr& labels);

/// All of it: PointCloud2 bytes to the clusters beside the largest plane.
std::vector<pcl::PointIndices> frontEnd(const pcl::PCLPointCloud2& message, const Forward& forward);

}  // namespace tabletop_perception::tools::stock
