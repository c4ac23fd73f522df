#include "tabletop_perception/depth_sensor.h"

#include <algorithm>
#include <cmath>

namespace tabletop_perception {
namespace {

constexpr double STEP_SHARE = 0.015;     // neighbours farther apart than this share of z are a step
constexpr float LIT_TOLERANCE = 0.008f;  // by which the projector's depth may be less [m]

bool isStep(float z, float other) {
  return !(std::abs(z - other) <= STEP_SHARE * std::min(z, other));  // with none it is one too
}

/// Indices of the pixels to the left, right, above and below, the pixel itself at the border.
struct Neighbours {
  std::size_t left, right, above, below;
};

Neighbours neighboursOf(const Cloud& cloud, int column, int row) {
  const auto at = [&](int c, int r) {
    return static_cast<std::size_t>(std::clamp(r, 0, cloud.height - 1)) * cloud.width +
           std::clamp(c, 0, cloud.width - 1);
  };
  return {at(column - 1, row), at(column + 1, row), at(column, row - 1), at(column, row + 1)};
}

bool besideStep(const Cloud& cloud, int column, int row) {
  const std::size_t i = static_cast<std::size_t>(row) * cloud.width + column;
  const auto n = neighboursOf(cloud, column, row);
  for (const auto other : {n.left, n.right, n.above, n.below})
    if (isStep(cloud.z[i], cloud.z[other])) return true;
  return false;
}

/// Whether the projector sees a point: the depth of what it sees there is not less.
bool isLit(const Eigen::Vector3f& p, const Cloud& projected, const Projection& projection,
           const DepthSensor& sensor) {
  const Eigen::Vector3d seen = projectorPose(sensor) * p.cast<double>();
  const Eigen::Vector2d pixel = projection.pixel(seen);
  const int row = static_cast<int>(std::lround(pixel.y()));
  const int left = static_cast<int>(std::floor(pixel.x()));
  // It lights a wider field than the camera sees.
  if (row < 0 || row >= projected.height || left < 0 || left + 1 >= projected.width) return true;
  const std::size_t i = static_cast<std::size_t>(row) * projected.width + left;
  const float depth = std::fmax(projected.z[i], projected.z[i + 1]);
  return std::isnan(depth) || seen.z() - depth <= LIT_TOLERANCE;
}

double grazingDropout(float cosine, const DepthSensor& sensor) {
  const double angle = std::acos(std::clamp(cosine, 0.0f, 1.0f)) * 180 / M_PI;
  return (angle - sensor.grazing_from_deg) / (sensor.grazing_to_deg - sensor.grazing_from_deg);
}

}  // namespace

double axialNoise(double z) { return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4); }

Eigen::Isometry3d projectorPose(const DepthSensor& sensor) {
  return Eigen::Isometry3d(Eigen::Translation3d(-sensor.baseline, 0, 0));
}

std::vector<float> incidence(const Cloud& cloud) {
  std::vector<float> cosines(cloud.size(), 0);
  for (int row = 0; row < cloud.height; ++row)
    for (int column = 0; column < cloud.width; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * cloud.width + column;
      if (!cloud.valid(i)) continue;
      auto n = neighboursOf(cloud, column, row);
      for (auto* other : {&n.left, &n.right, &n.above, &n.below})
        if (isStep(cloud.z[i], cloud.z[*other])) *other = i;
      const Eigen::Vector3f normal = (cloud.point(n.right) - cloud.point(n.left))
                                         .cross(cloud.point(n.below) - cloud.point(n.above));
      const float length = normal.norm();
      if (length > 0) cosines[i] = std::abs(normal.dot(cloud.point(i).normalized())) / length;
    }
  return cosines;
}

Cloud senseDepth(const Cloud& ideal, const Cloud& projected, const Projection& projection,
                 const DepthSensor& sensor, Random& random) {
  Cloud sensed(ideal.width, ideal.height, ideal.colored());
  sensed.rgb = ideal.rgb;
  const auto cosines = incidence(ideal);
  const double focal_baseline = std::abs(projection.fx) * sensor.baseline;
  for (int row = 0; row < ideal.height; ++row)
    for (int column = 0; column < ideal.width; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * ideal.width + column;
      std::size_t source = i;
      if (besideStep(ideal, column, row)) {
        const auto shift = [&] {
          const double pixels = sensor.edge_jitter * random.normal();
          return static_cast<int>(std::clamp(std::round(pixels), -1.0, 1.0));
        };
        const int c = std::clamp(column + shift(), 0, ideal.width - 1);
        const int r = std::clamp(row + shift(), 0, ideal.height - 1);
        source = static_cast<std::size_t>(r) * ideal.width + c;
        if (random.uniform(0, 1) < sensor.edge_dropout) continue;
      }
      if (!ideal.valid(source)) continue;
      if (random.uniform(0, 1) < grazingDropout(cosines[source], sensor)) continue;
      if (!isLit(ideal.point(source), projected, projection, sensor)) continue;

      const double z = ideal.z[source] + axialNoise(ideal.z[source]) * random.normal();
      if (z < sensor.min_range || z > sensor.max_range) continue;
      const double steps = std::round(focal_baseline / z / sensor.disparity_step);
      const double depth = focal_baseline / (steps * sensor.disparity_step);
      const Eigen::Vector3d ray{(column - projection.cx) / projection.fx,
                                (row - projection.cy) / projection.fy, 1};
      sensed.setPoint(i, (depth * ray).cast<float>());
    }
  return sensed;
}

}  // namespace tabletop_perception
