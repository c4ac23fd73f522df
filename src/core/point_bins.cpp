#include "point_bins.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int CHUNK = 128;  // points whose bins stay in the fastest memory
constexpr float PI = static_cast<float>(M_PI);

/// Of the points of a chunk.
struct ChunkBins {
  int alpha[CHUNK], phi[CHUNK], theta[CHUNK], distance[CHUNK], view[CHUNK];
};

/// atan2 within 2e-6 rad without a jump, so that loops vectorise: an odd polynomial fitted to the
/// arc tangent of 0 to 1.
inline float arcTangent(float y, float x) {
  const float ax = std::fabs(x), ay = std::fabs(y);
  const float large = ax > ay ? ax : ay, small = ax > ay ? ay : ax;
  const float t = small / (large + 1e-30f), s = t * t;
  float angle =
      t * (0.99997726f +
           s * (-0.33262347f +
                s * (0.19354346f + s * (-0.11643287f + s * (0.05265332f - s * 0.01172120f)))));
  angle = ay > ax ? PI / 2 - angle : angle;
  angle = x < 0 ? PI - angle : angle;
  return std::copysign(angle, y);
}

/// Of a value from 0 to 1.
inline int binOf(float share, int bins) {
  const int bin = static_cast<int>(share * static_cast<float>(bins));
  const int high = bin < bins ? bin : bins - 1;
  return high > 0 ? high : 0;
}

TABLETOP_SIMD_CLONES
void binChunk(const float* x, const float* y, const float* z, const float* nx, const float* ny,
              const float* nz, int count, const OrientedPoint& against, const BinCounts& counts,
              ChunkBins& bins) {
  const float cx = against.centroid.x(), cy = against.centroid.y(), cz = against.centroid.z();
  const float ax = against.axis.x(), ay = against.axis.y(), az = against.axis.z();
  const float gx = against.gaze.x(), gy = against.gaze.y(), gz = against.gaze.z();
  const float per_range = 1 / counts.distance_range;
  const int shape = counts.shape, view = counts.view;
  for (int i = 0; i < count; ++i) {
    const float dx = x[i] - cx, dy = y[i] - cy, dz = z[i] - cz;
    const float d = std::sqrt(dx * dx + dy * dy + dz * dz);
    const float per_d = d > 0 ? 1 / d : 0.0f;
    // A point in the centroid lies along the axis.
    const float lx = d > 0 ? dx * per_d : ax;
    const float ly = d > 0 ? dy * per_d : ay;
    const float lz = d > 0 ? dz * per_d : az;
    const float vx = ly * az - lz * ay, vy = lz * ax - lx * az, vz = lx * ay - ly * ax;
    const float length = std::sqrt(vx * vx + vy * vy + vz * vz);
    const float per_length = length > 1e-6f ? 1 / length : 1.0f;
    const float wx = ay * vz - az * vy, wy = az * vx - ax * vz, wz = ax * vy - ay * vx;

    const float along_v = (vx * nx[i] + vy * ny[i] + vz * nz[i]) * per_length;
    const float along_w = (wx * nx[i] + wy * ny[i] + wz * nz[i]) * per_length;
    const float along_axis = ax * nx[i] + ay * ny[i] + az * nz[i];
    const float to_gaze = gx * nx[i] + gy * ny[i] + gz * nz[i];
    bins.alpha[i] = binOf((along_v + 1) / 2, shape);
    bins.phi[i] = binOf((ax * lx + ay * ly + az * lz + 1) / 2, shape);
    bins.theta[i] = binOf((arcTangent(along_w, along_axis) + PI) / (2 * PI), shape);
    bins.distance[i] = binOf(d * per_range, shape);
    bins.view[i] = binOf((to_gaze + 1) / 2, view);
  }
}

}  // namespace

PlanarSurface::PlanarSurface(const Surface& surface) {
  for (auto* coordinates : {&x, &y, &z, &nx, &ny, &nz}) coordinates->resize(surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i) {
    x[i] = surface.points[i].x(), y[i] = surface.points[i].y(), z[i] = surface.points[i].z();
    nx[i] = surface.normals[i].x(), ny[i] = surface.normals[i].y(), nz[i] = surface.normals[i].z();
  }
}

PointBins::PointBins(const PlanarSurface& surface, const OrientedPoint& against,
                     const BinCounts& counts)
    : alpha(counts.shape),
      phi(counts.shape),
      theta(counts.shape),
      distance(counts.shape),
      view(counts.view) {
  ChunkBins bins;
  for (std::size_t first = 0; first < surface.size(); first += CHUNK) {
    const int count = static_cast<int>(std::min<std::size_t>(CHUNK, surface.size() - first));
    binChunk(&surface.x[first], &surface.y[first], &surface.z[first], &surface.nx[first],
             &surface.ny[first], &surface.nz[first], count, against, counts, bins);
    for (int i = 0; i < count; ++i) {
      ++alpha[bins.alpha[i]];
      ++phi[bins.phi[i]];
      ++theta[bins.theta[i]];
      ++distance[bins.distance[i]];
      ++view[bins.view[i]];
    }
  }
  const float share = 100.0f / static_cast<float>(surface.size());
  for (auto* block : {&alpha, &phi, &theta, &distance, &view})
    for (float& value : *block) value *= share;
}

}  // namespace tabletop_perception
