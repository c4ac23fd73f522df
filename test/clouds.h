#pragma once

#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/geometry.h"

/// Small clouds and surfaces made by hand.
namespace tabletop_perception::clouds {

constexpr float NO_POINT = std::numeric_limits<float>::quiet_NaN();

/// An unorganised cloud of these points.
inline Cloud cloudOf(const std::vector<Eigen::Vector3f>& points) {
  Cloud cloud(static_cast<int>(points.size()), 1, false);
  for (std::size_t i = 0; i < points.size(); ++i) cloud.setPoint(i, points[i]);
  return cloud;
}

/// The same points as one row, without the grid.
inline Cloud unorganised(Cloud cloud) {
  cloud.width = static_cast<int>(cloud.size());
  cloud.height = 1;
  return cloud;
}

/// The cloud as another camera's frame would hold it; pixels stay where they are.
inline Cloud turned(Cloud cloud, const Eigen::Isometry3d& T) {
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (cloud.valid(i)) cloud.setPoint(i, (T * cloud.point(i).cast<double>()).cast<float>());
  return cloud;
}

/// Points evenly distributed in a cube of the given half side about the origin [m].
inline std::vector<Eigen::Vector3f> randomPoints(int count, float half, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-half, half);
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < count; ++i) {
    const float x = coordinate(random), y = coordinate(random), z = coordinate(random);
    points.emplace_back(x, y, z);
  }
  return points;
}

/// A rotation by `degrees` about an axis and a shift [m].
inline Eigen::Isometry3d motion(double degrees, const Eigen::Vector3d& axis,
                                const Eigen::Vector3d& shift) {
  return Eigen::Translation3d(shift) * Eigen::AngleAxisd(degrees * M_PI / 180, axis.normalized());
}

/// What the call says when it refuses its arguments.
template <typename Call>
std::string refusalOf(Call call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "was not refused";
}

}  // namespace tabletop_perception::clouds
