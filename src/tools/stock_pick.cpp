#include "stock_pick.h"

#include <limits>

#include <pcl/common/centroid.h>
#include <pcl/common/io.h>
#include <pcl/common/pca.h>
#include <pcl/filters/crop_box.h>
#include <pcl/filters/extract_indices.h>
#include <pcl/filters/passthrough.h>

namespace tabletop_perception::tools::stock {
namespace {

using Point = Points::PointType;

constexpr std::uint32_t STEP = 2;  // between the columns and rows that a decimation keeps

Points::Ptr extracted(const Points::ConstPtr& points, const pcl::PointIndices& indices,
                      bool others) {
  pcl::ExtractIndices<Point> extract;
  extract.setInputCloud(points);
  extract.setIndices(pcl::PointIndices::ConstPtr(new pcl::PointIndices(indices)));
  extract.setNegative(others);
  const Points::Ptr part(new Points);
  extract.filter(*part);
  return part;
}

}  // namespace

Points::Ptr decimated(const Points::ConstPtr& points) {
  pcl::Indices kept;
  for (std::uint32_t row = 0; row < points->height; row += STEP)
    for (std::uint32_t column = 0; column < points->width; column += STEP)
      kept.push_back(static_cast<int>(row * points->width + column));
  const Points::Ptr fewer(new Points);
  pcl::copyPointCloud(*points, kept, *fewer);
  return fewer;
}

Points::Ptr depthWindow(const Points::ConstPtr& points, const Eigen::Vector3f& point,
                        const Forward& forward, double reach) {
  const auto middle = point[static_cast<int>(forward.axis[0] - 'x')];
  pcl::PassThrough<Point> pass;
  pass.setInputCloud(points);
  pass.setFilterFieldName(forward.axis);
  pass.setFilterLimits(middle - static_cast<float>(reach), middle + static_cast<float>(reach));
  const Points::Ptr window(new Points);
  pass.filter(*window);
  return window;
}

Points::Ptr besideLargestPlane(const Points::ConstPtr& points) {
  return extracted(points, packagedPcl().planeInliers(points), true);
}

Points::Ptr boxAndVoxels(const Points::ConstPtr& points, const Eigen::Vector3f& point,
                         double reach) {
  pcl::CropBox<Point> crop;
  crop.setInputCloud(points);
  const Eigen::Vector3f sides = Eigen::Vector3f::Constant(static_cast<float>(reach));
  const Eigen::Vector3f low = point - sides, high = point + sides;
  crop.setMin({low.x(), low.y(), low.z(), 1});
  crop.setMax({high.x(), high.y(), high.z(), 1});
  const Points::Ptr box(new Points);
  crop.filter(*box);
  return packagedPcl().voxelGrid(box);
}

Points::Ptr clusterAt(const Points::ConstPtr& points, const Eigen::Vector3f& point) {
  Points::Ptr nearest(new Points);
  float least = std::numeric_limits<float>::infinity();
  for (const auto& cluster : packagedPcl().euclideanClusters(points)) {
    Eigen::Vector4f centroid;
    pcl::compute3DCentroid(*points, cluster, centroid);
    const float squared = (centroid.head<3>() - point).squaredNorm();
    if (squared >= least) continue;
    least = squared;
    nearest = extracted(points, cluster, false);
  }
  return nearest;
}

Eigen::Isometry3f frameOf(const Points::ConstPtr& thing) {
  Eigen::Isometry3f frame = Eigen::Isometry3f::Identity();
  if (thing->size() < 3) return frame;
  pcl::PCA<Point> pca;
  pca.setInputCloud(extracted(thing, packagedPcl().planeInliers(thing), false));
  frame.linear() = pca.getEigenVectors();
  frame.translation() = pca.getMean().head<3>();
  return frame;
}

}  // namespace tabletop_perception::tools::stock
