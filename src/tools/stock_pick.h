#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "stock_pcl.h"

/// Stock PCL's way from a point to a frame on the thing there, step by step as studies of picking
/// with RGB-D cameras take it: what `tabletop benchmark` compares picks with.
namespace tabletop_perception::tools::stock {

/// Every second column and row.
Points::Ptr decimated(const Points::ConstPtr& points);

/// PassThrough: what lies no farther before or behind a point than `reach` [m] along the camera's
/// view.
Points::Ptr depthWindow(const Points::ConstPtr& points, const Eigen::Vector3f& point,
                        const Forward& forward, double reach);

/// SACSegmentation, and ExtractIndices for what lies beside the plane.
Points::Ptr besideLargestPlane(const Points::ConstPtr& points);

/// CropBox of twice the `reach` about a point, then VoxelGrid.
Points::Ptr boxAndVoxels(const Points::ConstPtr& points, const Eigen::Vector3f& point,
                         double reach);

/// EuclideanClusterExtraction; the points of the cluster with the nearest centroid.
Points::Ptr clusterAt(const Points::ConstPtr& points, const Eigen::Vector3f& point);

/// SACSegmentation of the thing's own main surface, and PCA within it; the identity for no thing.
Eigen::Isometry3f frameOf(const Points::ConstPtr& thing);

}  // namespace tabletop_perception::tools::stock
