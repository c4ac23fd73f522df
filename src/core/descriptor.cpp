#include "tabletop_perception/descriptor.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "tabletop_perception/kd_tree.h"

namespace tabletop_perception {
namespace {

constexpr int SHAPE_BINS = 45;
constexpr int VIEW_BINS = 128;
constexpr float CVFH_DISTANCE_BIN = 0.01f;  // [m]; 45 of them hold objects of up to 90 cm

int binOf(float value, float low, float high, int bins) {
  const int bin = static_cast<int>((value - low) / (high - low) * bins);
  return std::clamp(bin, 0, bins - 1);
}

/// The histograms of Rusu et al. 2010, eq. 1 to 3, of all points against one oriented point.
/// `distance_range`: the distance [m] that fills the last bin of the fourth block.
std::vector<float> histogram(const Surface& surface, const Eigen::Vector3f& centroid,
                             const Eigen::Vector3f& axis, const Eigen::Vector3f& viewpoint,
                             float distance_range) {
  std::vector<float> values(VFH_SIZE, 0.0f);
  float* alpha = values.data();
  float* phi = alpha + SHAPE_BINS;
  float* theta = phi + SHAPE_BINS;
  float* distance = theta + SHAPE_BINS;
  float* view = distance + SHAPE_BINS;
  const float share = 100.0f / static_cast<float>(surface.size());
  const Eigen::Vector3f gaze = (viewpoint - centroid).normalized();

  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Eigen::Vector3f& normal = surface.normals[i];
    const Eigen::Vector3f offset = surface.points[i] - centroid;
    const float d = offset.norm();
    const Eigen::Vector3f line = d > 0 ? Eigen::Vector3f(offset / d) : axis;
    Eigen::Vector3f v = line.cross(axis);
    if (const float length = v.norm(); length > 1e-6f) v /= length;
    const Eigen::Vector3f w = axis.cross(v);

    alpha[binOf(v.dot(normal), -1, 1, SHAPE_BINS)] += share;
    phi[binOf(axis.dot(line), -1, 1, SHAPE_BINS)] += share;
    theta[binOf(std::atan2(w.dot(normal), axis.dot(normal)), -static_cast<float>(M_PI),
                static_cast<float>(M_PI), SHAPE_BINS)] += share;
    distance[binOf(d, 0, distance_range, SHAPE_BINS)] += share;
    view[binOf(gaze.dot(normal), -1, 1, VIEW_BINS)] += share;
  }
  return values;
}

Eigen::Vector3f meanNormal(const Surface& surface) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const auto& normal : surface.normals) sum += normal;
  return sum.norm() > 0 ? Eigen::Vector3f(sum.normalized()) : Eigen::Vector3f::UnitZ();
}

Surface subset(const Surface& surface, const std::vector<int>& indices) {
  Surface part;
  for (const int i : indices) {
    part.points.push_back(surface.points[i]);
    part.normals.push_back(surface.normals[i]);
  }
  return part;
}

/// Points whose surroundings bend too much to belong to a smooth region: the neighbours' normals
/// cancel out by more than `limit`.
std::vector<bool> bentPoints(const Surface& surface, const std::vector<std::vector<int>>& neighbors,
                             double limit) {
  std::vector<bool> bent(surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (const int j : neighbors[i]) sum += surface.normals[j];
    bent[i] = 1 - sum.norm() / static_cast<float>(neighbors[i].size()) > limit;
  }
  return bent;
}

std::vector<std::vector<int>> neighborsOf(const Surface& surface, double radius) {
  const KdTree tree(surface.points);
  std::vector<KdTree::Neighbor> within;
  std::vector<std::vector<int>> neighbors(surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i) {
    tree.within(surface.points[i], radius, within);
    for (const auto& neighbor : within) neighbors[i].push_back(neighbor.index);
  }
  return neighbors;
}

/// Groups of neighbours whose normals differ little from one to the next, in order of first point.
std::vector<std::vector<int>> smoothRegions(const Surface& surface,
                                            const DescriptorOptions& options) {
  const auto neighbors = neighborsOf(surface, options.region_radius);
  std::vector<bool> taken = bentPoints(surface, neighbors, options.region_curvature);
  const auto min_dot = static_cast<float>(std::cos(options.region_angle_deg * M_PI / 180));

  std::vector<std::vector<int>> regions;
  for (std::size_t seed = 0; seed < surface.size(); ++seed) {
    if (taken[seed]) continue;
    std::vector<int> region{static_cast<int>(seed)};
    taken[seed] = true;
    for (std::size_t next = 0; next < region.size(); ++next)
      for (const int j : neighbors[region[next]]) {
        if (taken[j] || surface.normals[region[next]].dot(surface.normals[j]) < min_dot) continue;
        taken[j] = true;
        region.push_back(j);
      }
    if (static_cast<int>(region.size()) >= options.region_min_points)
      regions.push_back(std::move(region));
  }
  return regions;
}

}  // namespace

Descriptor computeVfh(const Surface& surface, const Eigen::Vector3f& viewpoint) {
  if (surface.empty()) throw std::invalid_argument("vfh: the surface has no points");
  const Eigen::Vector3f centroid = centroidOf(surface.points);
  float farthest = 0;
  for (const auto& p : surface.points) farthest = std::max(farthest, (p - centroid).norm());
  return {"vfh",
          histogram(surface, centroid, meanNormal(surface), viewpoint, std::max(farthest, 1e-6f)),
          centroid};
}

std::vector<Surface> smoothParts(const Surface& surface, const DescriptorOptions& options) {
  std::vector<bool> in_part(surface.size(), false);
  std::vector<Surface> parts;
  for (const auto& region : smoothRegions(surface, options)) {
    for (const int i : region) in_part[i] = true;
    parts.push_back(subset(surface, region));
  }
  std::vector<int> rest;
  for (std::size_t i = 0; i < surface.size(); ++i)
    if (!in_part[i]) rest.push_back(static_cast<int>(i));
  parts.push_back(subset(surface, rest));
  return parts;
}

std::vector<Descriptor> computeCvfh(const Surface& surface, const Eigen::Vector3f& viewpoint,
                                    const DescriptorOptions& options) {
  std::vector<Descriptor> descriptors;
  if (surface.empty()) return descriptors;
  // Poses are aligned by the centroid of everything, which a change of the region's outline moves
  // less than the region's own.
  const Eigen::Vector3f centroid = centroidOf(surface.points);
  for (const auto& region : smoothRegions(surface, options)) {
    const Surface part = subset(surface, region);
    descriptors.push_back({"cvfh",
                           histogram(surface, centroidOf(part.points), meanNormal(part), viewpoint,
                                     SHAPE_BINS * CVFH_DISTANCE_BIN),
                           centroid});
  }
  return descriptors;
}

std::vector<Descriptor> describeSurface(const Surface& surface, const Eigen::Vector3f& viewpoint,
                                        const DescriptorOptions& options) {
  if (static_cast<int>(surface.size()) < options.min_points) return {};
  std::vector<Descriptor> all{computeVfh(surface, viewpoint)};
  for (auto& descriptor : computeCvfh(surface, viewpoint, options))
    all.push_back(std::move(descriptor));
  return all;
}

}  // namespace tabletop_perception
