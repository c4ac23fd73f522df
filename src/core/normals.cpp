#include "tabletop_perception/normals.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Eigenvalues>

#include "grid_normals.h"
#include "integral_normals.h"
#include "radius_grid.h"
#include "tabletop_perception/kd_tree.h"
#include "voxel_key.h"

namespace tabletop_perception {
namespace {

constexpr int MIN_NEIGHBORS = 4;  // three points always lie on a plane, whatever they are

struct PlaneFit {
  Eigen::Vector3f normal;
  float curvature;
};

/// The direction of least variance; none when the points are too few or lie on a line.
std::optional<PlaneFit> fitPlane(const Moments& moments) {
  if (moments.count < MIN_NEIGHBORS) return std::nullopt;
  const float n = static_cast<float>(moments.count);
  const Eigen::Matrix3f covariance =
      moments.products / n - (moments.sum / n) * (moments.sum / n).transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> solver;
  solver.computeDirect(covariance);
  const Eigen::Vector3f values = solver.eigenvalues();
  if (!(values[1] > 1e-3f * values[2])) return std::nullopt;
  const float least = std::max(0.0f, values[0]);
  return PlaneFit{solver.eigenvectors().col(0).normalized(),
                  least / (least + values[1] + values[2])};
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
  Surface surface;
  surface.points = points;
  surface.normals.assign(points.size(), Eigen::Vector3f::UnitZ());
  return downsampled(surface, leaf).points;
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
  for (const int i : valid) {
    const Eigen::Vector3f p = cloud.point(i);
    const auto fit = fitPlane(nearestMoments(tree, p, options.neighbors, nearest));
    if (!fit) continue;
    const Eigen::Vector3f normal = turnedTowards(fit->normal, p, viewpoint);
    normals.x[i] = normal.x();
    normals.y[i] = normal.y();
    normals.z[i] = normal.z();
    normals.curvature[i] = fit->curvature;
  }
  return normals;
}

Surface sampleSurface(const std::vector<Eigen::Vector3f>& points, double leaf, double radius,
                      const Eigen::Vector3f& viewpoint) {
  const auto means = voxelMeans(points, leaf);
  const RadiusGrid near(means, radius);
  Surface surface;
  for (const auto& p : means) {
    const auto fit = fitPlane(near.momentsAbout(p));
    if (!fit) continue;
    surface.points.push_back(p);
    surface.normals.push_back(turnedTowards(fit->normal, p, viewpoint));
  }
  return surface;
}

}  // namespace tabletop_perception
