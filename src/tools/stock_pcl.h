#pragma once

#include <string>
#include <vector>

#include <pcl/PCLPointCloud2.h>
#include <pcl/PointIndices.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "stock_cloud.h"

/// Stock PCL's way through the front end, set up as its tutorials do: what `tabletop benchmark`
/// compares with. Its algorithm headers, which are slow to compile, stay behind this one. Every
/// call builds its PCL objects anew, as their answers may depend on what they did before.
namespace tabletop_perception::tools::stock {

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

/// One compilation of PCL's algorithms. Clouds leave it as pointers: only the build that allocated
/// points, aligned as it needs them, can free them.
struct Build {
  /// PointCloud2 bytes to points within MIN_DEPTH and MAX_DEPTH; the others NaN if `organized`,
  /// else left out.
  Points::Ptr (*crop)(const pcl::PCLPointCloud2& message, const Forward& forward, bool organized);

  Points::Ptr (*voxelGrid)(const Points::ConstPtr& points);

  /// By integral images, with one of the methods that NormalsOptions names; NaN where there is
  /// none. The cloud must be organised.
  pcl::PointCloud<pcl::Normal>::Ptr (*normals)(const Points::ConstPtr& points,
                                               const std::string& method);

  /// Points on the largest plane.
  pcl::PointIndices (*planeInliers)(const Points::ConstPtr& points);

  /// EuclideanClusterExtraction with a kd-tree. The points must be finite.
  std::vector<pcl::PointIndices> (*euclideanClusters)(const Points::ConstPtr& points);

  /// OrganizedConnectedComponentSegmentation with a EuclideanClusterComparator of the points whose
  /// label is 1.
  std::vector<pcl::PointIndices> (*organizedClusters)(const Points::ConstPtr& points,
                                                      const Labels::Ptr& labels);

  /// All of it: PointCloud2 bytes to the clusters beside the largest plane.
  std::vector<pcl::PointIndices> (*frontEnd)(const pcl::PCLPointCloud2& message,
                                             const Forward& forward);
};

/// PCL as it is packaged.
const Build& packagedPcl();

/// PCL's headers compiled once more, optimised for the processor that compiles them. Only where the
/// build is told so: TABLETOP_REBUILT_PCL.
const Build& rebuiltPcl();

}  // namespace tabletop_perception::tools::stock
