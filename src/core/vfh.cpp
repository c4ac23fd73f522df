#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "point_bins.h"
#include "tabletop_perception/descriptor.h"
#include "tabletop_perception/region_growing.h"

namespace tabletop_perception {
namespace {

constexpr float CVFH_DISTANCE_BIN = 0.01f;  // [m]; 45 of them hold objects of up to 90 cm

/// The histograms of Rusu et al. 2010, eq. 1 to 3, of all points against one oriented point.
/// `distance_range`: the distance [m] that fills the last bin of the fourth block.
std::vector<float> histogram(const PlanarSurface& surface, const Eigen::Vector3f& centroid,
                             const Eigen::Vector3f& axis, const Eigen::Vector3f& viewpoint,
                             float distance_range) {
  const PointBins bins(surface, {centroid, axis, (viewpoint - centroid).normalized()},
                       {SHAPE_BINS, VIEW_BINS, distance_range});
  std::vector<float> values;
  for (const auto* block : {&bins.alpha, &bins.phi, &bins.theta, &bins.distance, &bins.view})
    values.insert(values.end(), block->begin(), block->end());
  return values;
}

float farthestFrom(const Eigen::Vector3f& centroid, const std::vector<Eigen::Vector3f>& points) {
  float squared = 0;
  for (const auto& p : points) squared = std::max(squared, (p - centroid).squaredNorm());
  return std::sqrt(squared);
}

// --- as PCL 1.13 computes it

/// pcl::computePairFeatures of the centroid and a point: three angles and their distance; false
/// where they are not defined.
bool pairFeatures(const Eigen::Vector3f& centroid, const Eigen::Vector3f& axis,
                  const Eigen::Vector3f& point, const Eigen::Vector3f& normal,
                  std::array<float, 4>& features) {
  Eigen::Vector3f line = point - centroid;
  const float distance = line.norm();
  if (distance == 0) return false;
  const float of_axis = axis.dot(line) / distance, of_normal = normal.dot(line) / distance;
  // The normal that leans less to the line leads.
  const bool swapped = std::acos(std::abs(of_axis)) > std::acos(std::abs(of_normal));
  const Eigen::Vector3f& first = swapped ? normal : axis;
  const Eigen::Vector3f& second = swapped ? axis : normal;
  if (swapped) line = -line;
  Eigen::Vector3f v = line.cross(first);
  const float length = v.norm();
  if (length == 0) return false;
  v /= length;
  const Eigen::Vector3f w = first.cross(v);
  features = {std::atan2(w.dot(second), first.dot(second)), v.dot(second),
              swapped ? -of_normal : of_axis, distance};
  return true;
}

int clampedBin(double share, int bins) {
  return std::clamp(static_cast<int>(std::floor(share * bins)), 0, bins - 1);
}

}  // namespace

Descriptor computeVfh(const Surface& surface, const Eigen::Vector3f& viewpoint) {
  if (surface.empty()) throw std::invalid_argument("vfh: the surface has no points");
  const Eigen::Vector3f centroid = centroidOf(surface.points);
  const float farthest = std::max(farthestFrom(centroid, surface.points), 1e-6f);
  return {"vfh",
          histogram(PlanarSurface(surface), centroid, meanNormal(surface), viewpoint, farthest),
          centroid, std::nullopt};
}

std::vector<Descriptor> computeCvfh(const Surface& surface, const std::vector<Indices>& regions,
                                    const Eigen::Vector3f& viewpoint) {
  std::vector<Descriptor> descriptors;
  if (regions.empty()) return descriptors;
  // Poses are aligned by the centroid of everything, which a change of the region's outline moves
  // less than the region's own.
  const Eigen::Vector3f centroid = centroidOf(surface.points);
  const PlanarSurface planar(surface);
  for (const auto& region : regions) {
    const Surface part = selected(surface, region);
    descriptors.push_back({"cvfh",
                           histogram(planar, centroidOf(part.points), meanNormal(part), viewpoint,
                                     SHAPE_BINS * CVFH_DISTANCE_BIN),
                           centroid, std::nullopt});
  }
  return descriptors;
}

std::vector<float> computeVfhAsPcl(const Surface& surface, const Eigen::Vector3f& viewpoint) {
  if (surface.size() < 2) throw std::invalid_argument("vfh: the surface has under two points");
  const Eigen::Vector3f centroid = centroidOf(surface.points);
  Eigen::Vector3f axis = Eigen::Vector3f::Zero();
  for (const auto& normal : surface.normals) axis += normal;
  axis /= static_cast<float>(surface.size());  // not of unit length
  // The centroid's homogeneous coordinate counts as a fourth in two lengths.
  Eigen::Vector4f gaze(0, 0, 0, -1);
  gaze.head<3>() = viewpoint - centroid;
  gaze.normalize();
  const float farthest = std::hypot(farthestFrom(centroid, surface.points), 1.0f);

  std::vector<float> values(VFH_SIZE, 0.0f);
  float *const theta = values.data(), *const alpha = theta + SHAPE_BINS,
               *const phi = alpha + SHAPE_BINS, *const distance = phi + SHAPE_BINS,
               *const view = distance + SHAPE_BINS;
  const float share = 100.0f / static_cast<float>(surface.size() - 1);
  std::array<float, 4> features;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const Eigen::Vector3f& normal = surface.normals[i];
    view[clampedBin((normal.dot(gaze.head<3>()) + 1) / 2, VIEW_BINS)] +=
        100.0f / static_cast<float>(surface.size());
    if (!pairFeatures(centroid, axis, surface.points[i], normal, features)) continue;
    // All three in the range of the first, so the other two fill a third of their bins.
    const auto angleBin = [](float f) { return clampedBin((f + M_PI) / (2 * M_PI), SHAPE_BINS); };
    theta[angleBin(features[0])] += share;
    alpha[angleBin(features[1])] += share;
    phi[angleBin(features[2])] += share;
    distance[clampedBin(features[3] / farthest, SHAPE_BINS)] += share;
  }
  return values;
}

}  // namespace tabletop_perception
