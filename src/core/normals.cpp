#include "tabletop_perception/normals.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "grid_normals.h"
#include "integral_normals.h"
#include "plane_of_moments.h"
#include "radius_grid.h"
#include "tabletop_perception/kd_tree.h"
#include "voxel_numbers.h"

namespace tabletop_perception {
namespace {

/// Fits a plane to each of `count` neighbourhoods. Calls take(i, normal, curvature) for those whose
/// points are enough and lie on no line. `momentsOf(i)`: of the points of one.
template <typename MomentsOf, typename Take>
void visitPlanes(std::size_t count, MomentsOf momentsOf, Take take) {
  constexpr std::size_t LANES = LaneMoments::LANES;
  for (std::size_t first = 0; first < count; first += LANES) {
    const int lanes = static_cast<int>(std::min(LANES, count - first));
    LaneMoments all;
    for (int l = 0; l < lanes; ++l) {
      const Moments moments = momentsOf(first + l);
      all.n[l] = static_cast<float>(moments.count);
      all.x[l] = moments.sum.x();
      all.y[l] = moments.sum.y();
      all.z[l] = moments.sum.z();
      all.xx[l] = moments.products(0, 0);
      all.xy[l] = moments.products(0, 1);
      all.xz[l] = moments.products(0, 2);
      all.yy[l] = moments.products(1, 1);
      all.yz[l] = moments.products(1, 2);
      all.zz[l] = moments.products(2, 2);
    }
    LaneNormals planes;
    fitPlanes(all, planes);
    for (int l = 0; l < lanes; ++l)
      if (!std::isnan(planes.x[l]))
        take(first + l, Eigen::Vector3f(planes.x[l], planes.y[l], planes.z[l]),
             planes.curvature[l]);
  }
}

Eigen::Vector3f turnedTowards(const Eigen::Vector3f& normal, const Eigen::Vector3f& point,
                              const Eigen::Vector3f& viewpoint) {
  return normal.dot(viewpoint - point) < 0 ? Eigen::Vector3f(-normal) : normal;
}

Moments nearestMoments(const KdTree& tree, const Eigen::Vector3f& p, int k,
                       std::vector<KdTree::Neighbor>& nearest) {
  tree.nearest(p, k, nearest);
  Moments moments;
  for (const auto& neighbor : nearest) {
    const Eigen::Vector3f d = tree.points()[neighbor.index] - p;
    moments.sum += d;
    moments.products += d * d.transpose();
    ++moments.count;
  }
  return moments;
}

std::vector<Eigen::Vector3f> voxelMeans(const std::vector<Eigen::Vector3f>& points, double leaf) {
  if (!(leaf > 0))
    throw std::invalid_argument("leaf must be positive, got " + std::to_string(leaf));
  VoxelNumbers voxels;
  std::vector<Eigen::Vector3f> means;
  std::vector<int> counts;
  for (const auto& p : points) {
    const int voxel = voxels.numberOf(VoxelKey::of(p, 1.0 / leaf));
    if (voxel == static_cast<int>(means.size())) {
      means.emplace_back(Eigen::Vector3f::Zero());
      counts.push_back(0);
    }
    means[voxel] += p;
    ++counts[voxel];
  }
  for (std::size_t i = 0; i < means.size(); ++i) means[i] /= static_cast<float>(counts[i]);
  return means;
}

}  // namespace

Normals computeNormals(const Cloud& cloud, const Eigen::Vector3f& viewpoint,
                       const NormalsOptions& options) {
  checkOptions("normals", options);
  if (cloud.organized())
    return options.method == "window" ? computeGridNormals(cloud, viewpoint, options)
                                      : computeIntegralNormals(cloud, viewpoint, options);

  const std::vector<float> none(cloud.size(), std::numeric_limits<float>::quiet_NaN());
  Normals normals{none, none, none, none};
  const Indices valid = validIndices(cloud);
  const KdTree tree(pointsAt(cloud, valid));
  std::vector<KdTree::Neighbor> nearest;
  const auto momentsOf = [&](std::size_t k) {
    return nearestMoments(tree, tree.points()[k], options.neighbors, nearest);
  };
  visitPlanes(valid.size(), momentsOf,
              [&](std::size_t k, const Eigen::Vector3f& plane_normal, float curvature) {
                const Eigen::Vector3f normal =
                    turnedTowards(plane_normal, tree.points()[k], viewpoint);
                normals.x[valid[k]] = normal.x();
                normals.y[valid[k]] = normal.y();
                normals.z[valid[k]] = normal.z();
                normals.curvature[valid[k]] = curvature;
              });
  return normals;
}

Surface sampleSurface(const std::vector<Eigen::Vector3f>& points, double leaf, double radius,
                      const Eigen::Vector3f& viewpoint) {
  const auto means = voxelMeans(points, leaf);
  const RadiusGrid near(means, radius);
  Surface surface;
  visitPlanes(
      means.size(), [&](std::size_t i) { return near.momentsAbout(means[i]); },
      [&](std::size_t i, const Eigen::Vector3f& normal, float) {
        surface.points.push_back(means[i]);
        surface.normals.push_back(turnedTowards(normal, means[i], viewpoint));
      });
  return surface;
}

}  // namespace tabletop_perception
