#include "tabletop_perception/planes.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <random>

#include "plane_fit.h"
#include "union_find.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t SAMPLE_SIZE = 1000;   // points that RANSAC looks at
constexpr double AGREEMENT_COSINE = 0.966;  // of 15 deg

/// Tells which points lie on one plane.
class PlaneComparator {
 public:
  PlaneComparator(const Cloud& cloud, const Normals& normals, const PlaneOptions& options)
      : cloud_(cloud),
        normals_(normals),
        min_cosine_(static_cast<float>(std::cos(options.max_angle_deg * M_PI / 180))),
        max_offset_(static_cast<float>(options.max_offset)),
        max_curvature_(static_cast<float>(options.max_curvature)) {}

  bool flat(int i) const { return normals_.curvature[i] <= max_curvature_; }  // false for NaN

  /// Offsets are compared at the neighbour, not at the origin: there a normal's noise would count
  /// with the full distance from the sensor.
  bool together(int i, int j) const {
    const Eigen::Vector3f a = normal(i), b = normal(j), d = cloud_.point(j) - cloud_.point(i);
    return a.dot(b) >= min_cosine_ && std::abs(a.dot(d)) <= max_offset_ &&
           std::abs(b.dot(d)) <= max_offset_;
  }

 private:
  Eigen::Vector3f normal(int i) const { return {normals_.x[i], normals_.y[i], normals_.z[i]}; }

  const Cloud& cloud_;
  const Normals& normals_;
  float min_cosine_, max_offset_, max_curvature_;
};

/// The connected components of flat pixels, each ascending, in the order of their first pixel.
std::vector<Indices> componentsOf(const Cloud& cloud, const PlaneComparator& compare) {
  UnionFind sets(cloud.size());
  const auto joinIf = [&](int i, int j) {
    if (compare.flat(j) && compare.together(i, j)) sets.join(i, j);
  };
  for (int row = 0; row < cloud.height; ++row)
    for (int column = 0; column < cloud.width; ++column) {
      const int i = row * cloud.width + column;
      if (!compare.flat(i)) continue;
      if (column > 0) joinIf(i, i - 1);
      if (row == 0) continue;
      joinIf(i, i - cloud.width);
      if (column > 0) joinIf(i, i - cloud.width - 1);
      if (column + 1 < cloud.width) joinIf(i, i - cloud.width + 1);
    }

  std::vector<Indices> components;
  std::vector<int> component_of(cloud.size(), -1);
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
    if (!compare.flat(i)) continue;
    int& component = component_of[sets.root(i)];
    if (component < 0) {
      component = static_cast<int>(components.size());
      components.emplace_back();
    }
    components[component].push_back(i);
  }
  return components;
}

/// The plane of least squares of the given points, at least three, its normal turned as `facing`.
Plane planeThrough(const Cloud& cloud, Indices points, const Eigen::Vector3d& facing) {
  Plane plane;
  for (const int i : points) plane.centroid += cloud.point(i).cast<double>();
  plane.centroid /= static_cast<double>(points.size());
  plane.plane << facing, -facing.dot(plane.centroid);
  const auto fit = fitPlaneNear(selectPoints(cloud, points), plane.plane,
                                std::numeric_limits<float>::infinity());
  plane.plane = fit->plane.head<3>().dot(facing) < 0 ? Eigen::Vector4d(-fit->plane) : fit->plane;
  plane.rms = fit->rms;
  plane.points = std::move(points);
  return plane;
}

Eigen::Vector3d meanNormal(const Normals& normals, const Indices& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int i : points) sum += Eigen::Vector3d(normals.x[i], normals.y[i], normals.z[i]);
  return sum.normalized();
}

}  // namespace

std::vector<Plane> findPlanes(const Cloud& cloud, const Normals& normals,
                              const PlaneOptions& options) {
  checkOptions("planes", options);
  if (!cloud.organized()) return {};
  std::vector<Plane> planes;
  for (const auto& points : componentsOf(cloud, PlaneComparator(cloud, normals, options))) {
    if (static_cast<int>(points.size()) < options.min_points) continue;
    Plane plane = planeThrough(cloud, points, meanNormal(normals, points));
    const double agreement = normalAgreement(normals, plane.points, plane.plane.head<3>());
    if (agreement >= MIN_NORMAL_AGREEMENT) planes.push_back(std::move(plane));
  }
  std::stable_sort(planes.begin(), planes.end(), [](const Plane& a, const Plane& b) {
    return a.points.size() > b.points.size();
  });
  return planes;
}

std::optional<Plane> findLargestPlane(const Cloud& cloud, double distance,
                                      const std::optional<PlaneConstraint>& constraint,
                                      std::uint32_t seed) {
  std::mt19937 random(seed);
  const Cloud sample = samplePoints(cloud, SAMPLE_SIZE);
  const auto drawn = drawPlane(sample, distance, constraint, random);
  if (!drawn) return std::nullopt;
  const auto coarse = fitPlaneNear(sample, *drawn, distance);
  const auto fit =
      fitPlaneNear(cloud, coarse ? coarse->plane : *drawn, distance, shareOf(cloud.size()));
  if (!fit) return std::nullopt;
  Plane plane;
  plane.plane = fit->plane[3] < 0 ? Eigen::Vector4d(-fit->plane) : fit->plane;
  plane.centroid = fit->centroid;
  plane.rms = fit->rms;
  plane.points = pointsNearPlane(cloud, plane.plane, distance);
  return plane;
}

Plane mergedPlane(const Cloud& cloud, const Plane& a, const Plane& b) {
  Indices points;
  std::merge(a.points.begin(), a.points.end(), b.points.begin(), b.points.end(),
             std::back_inserter(points));
  return planeThrough(cloud, std::move(points), a.plane.head<3>());
}

double normalAgreement(const Normals& normals, const Indices& points,
                       const Eigen::Vector3d& normal) {
  int agreeing = 0, counted = 0;
  for (const int i : points) {
    if (std::isnan(normals.x[i])) continue;
    const double cosine =
        normals.x[i] * normal.x() + normals.y[i] * normal.y() + normals.z[i] * normal.z();
    agreeing += std::abs(cosine) >= AGREEMENT_COSINE;
    ++counted;
  }
  return counted > 0 ? static_cast<double>(agreeing) / counted : 0;
}

}  // namespace tabletop_perception
