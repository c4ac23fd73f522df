#include <cmath>

#include "tabletop_perception/descriptor.h"

namespace tabletop_perception {

Descriptor computeCameraRoll(const Surface& surface, const Eigen::Vector3f& viewpoint) {
  Descriptor roll{"camera_roll", std::vector<float>(ROLL_BINS, 0.0f), Eigen::Vector3f::Zero(),
                  std::nullopt};
  if (surface.empty()) return roll;
  roll.centroid = centroidOf(surface.points);
  const Eigen::Vector3d axis = (roll.centroid - viewpoint).cast<double>().normalized();
  const Eigen::Matrix3f R = rotationBetween(axis, Eigen::Vector3d::UnitZ()).cast<float>();
  const float share = 100.0f / static_cast<float>(surface.size());
  for (const auto& normal : surface.normals) {
    const Eigen::Vector3f n = R * normal;
    const float weight = share * n.head<2>().norm();
    // To the two nearest bins, which lie round a circle.
    const double at = (std::atan2(n.y(), n.x()) / (2 * M_PI) + 1) * ROLL_BINS;
    const int low = static_cast<int>(at);
    const auto high_share = static_cast<float>(at - low);
    roll.values[low % ROLL_BINS] += weight * (1 - high_share);
    roll.values[(low + 1) % ROLL_BINS] += weight * high_share;
  }
  return roll;
}

}  // namespace tabletop_perception
