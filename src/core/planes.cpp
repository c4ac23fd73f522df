#include "tabletop_perception/planes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <random>

#include "plane_fit.h"
#include "simd.h"
#include "union_find.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t SAMPLE_SIZE = 1000;   // points that RANSAC looks at
constexpr double AGREEMENT_COSINE = 0.966;  // of 15 deg

/// What has to hold for two neighbouring points to lie on one plane.
struct PlaneLimits {
  float min_cosine, max_offset, max_curvature;

  explicit PlaneLimits(const PlaneOptions& options)
      : min_cosine(static_cast<float>(std::cos(options.max_angle_deg * M_PI / 180))),
        max_offset(static_cast<float>(options.max_offset)),
        max_curvature(static_cast<float>(options.max_curvature)) {}
};

/// Points and normals of an organised cloud.
struct GridPointers {
  const float *x, *y, *z, *nx, *ny, *nz, *curvature;

  GridPointers(const Cloud& cloud, const Normals& normals, std::size_t from)
      : x(cloud.x.data() + from),
        y(cloud.y.data() + from),
        z(cloud.z.data() + from),
        nx(normals.x.data() + from),
        ny(normals.y.data() + from),
        nz(normals.z.data() + from),
        curvature(normals.curvature.data() + from) {}
};

/// Marks the pixels that lie on one plane with their neighbours. Offsets are
/// compared at the neighbour, not at the origin: there a normal's noise would count with the full
/// distance from the sensor.
TABLETOP_SIMD_CLONES
void markTogether(const GridPointers& pixels, const GridPointers& neighbors, std::size_t count,
                  const PlaneLimits& limits, std::uint8_t* __restrict marks) {
  const GridPointers a = pixels, b = neighbors;
  const auto [min_cosine, max_offset, max_curvature] = limits;
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = b.x[i] - a.x[i], dy = b.y[i] - a.y[i], dz = b.z[i] - a.z[i];
    const float cosine = a.nx[i] * b.nx[i] + a.ny[i] * b.ny[i] + a.nz[i] * b.nz[i];
    const float from_a = a.nx[i] * dx + a.ny[i] * dy + a.nz[i] * dz;
    const float from_b = b.nx[i] * dx + b.ny[i] * dy + b.nz[i] * dz;
    marks[i] = (a.curvature[i] <= max_curvature) & (b.curvature[i] <= max_curvature) &
               (cosine >= min_cosine) & (std::abs(from_a) <= max_offset) &
               (std::abs(from_b) <= max_offset);  // false for NaN
  }
}

/// The connected components of flat pixels, each ascending, in the order of their first pixel.
std::vector<Indices> componentsOf(const Cloud& cloud, const Normals& normals,
                                  const PlaneOptions& options) {
  const PlaneLimits limits(options);
  UnionFind sets(cloud.size());
  const auto width = static_cast<std::size_t>(cloud.width);
  std::vector<std::uint8_t> marks(width);
  // Joins the pixels of a row from `column` on, as far as they lie on a plane with their
  // neighbours.
  const auto join = [&](std::size_t row, std::size_t column, std::ptrdiff_t to_neighbor,
                        std::size_t count) {
    const std::size_t first = row * width + column;
    const std::size_t neighbor = first + static_cast<std::size_t>(to_neighbor);
    markTogether({cloud, normals, first}, {cloud, normals, neighbor}, count, limits, marks.data());
    for (std::size_t i = 0; i < count; ++i)
      if (marks[i]) sets.join(static_cast<int>(first + i), static_cast<int>(neighbor + i));
  };
  const auto up = -static_cast<std::ptrdiff_t>(width);
  for (std::size_t row = 0; row < static_cast<std::size_t>(cloud.height); ++row) {
    join(row, 1, -1, width - 1);
    if (row == 0) continue;
    join(row, 0, up, width);
    join(row, 1, up - 1, width - 1);
    join(row, 0, up + 1, width - 1);
  }

  std::vector<Indices> components;
  std::vector<int> component_of(cloud.size(), -1);
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
    if (!(normals.curvature[i] <= limits.max_curvature)) continue;
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
  for (const auto& points : componentsOf(cloud, normals, options)) {
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
