#include "lift.h"

#include <algorithm>
#include <cmath>

#include "lowest_point.h"

namespace tabletop_perception {
namespace {

constexpr double UNDERSIDE = 0.03;     // of an object, about its lowest point [m]
constexpr double CARRIER_NEAR = 0.01;  // what carries an object lies no farther beside it [m]
constexpr int MIN_CARRIER_POINTS = 10;
constexpr float SEEN_PAST = 0.02f;  // farther behind a point the camera has seen past it [m]

/// Whether the camera looked past most of some points, of those that nothing nearer hides from it:
/// nothing is there.
bool isSeenThrough(const Observation& observation, const std::vector<Eigen::Vector3f>& points) {
  if (!observation.projection || !observation.sightings) return false;
  const auto& camera = *observation.projection;
  int past = 0, there = 0;
  for (const auto& p : points) {
    const Eigen::Vector2d pixel = camera.pixel(p.cast<double>());
    const auto u = std::lround(pixel.x()), v = std::lround(pixel.y());
    if (u < 0 || v < 0 || u >= camera.width || v >= camera.height) continue;
    const float range = (*observation.sightings)[v * camera.width + u].range;
    past += range > p.norm() + SEEN_PAST;
    there += std::abs(range - p.norm()) <= SEEN_PAST;
  }
  return past > there;
}

/// Whether points that an object does not explain lie right under it, and not all that there is
/// under these is air. `surface`: of the object; `lowest`: height of its lowest point [m].
bool isCarried(const std::vector<Eigen::Vector3f>& surface, double lowest,
               const std::vector<Surface>& parts, const Marks& explained,
               const Observations& observations, const Table& table) {
  if (lowest < UNDERSIDE) return false;
  const Eigen::Vector3f up = table.plane.head<3>().cast<float>();
  std::vector<Eigen::Vector3f> foot, below;  // `below`: half-way down to the table
  Eigen::AlignedBox3f about;                 // what carries it lies in there
  for (const auto& p : surface) {
    if (heightAbove(table, p) >= lowest + UNDERSIDE) continue;
    foot.push_back(p);
    below.push_back(p - static_cast<float>(heightAbove(table, p) / 2) * up);
    about.extend(p);
  }
  if (foot.empty() || isSeenThrough(observations.about(centroidOf(foot)), below)) return false;
  const auto reach = Eigen::Vector3f::Constant(CARRIER_NEAR + 2 * UNDERSIDE);
  about = Eigen::AlignedBox3f(about.min() - reach, about.max() + reach);
  const auto isUnder = [&](const Eigen::Vector3f& p) {
    const double height = heightAbove(table, p) - lowest;
    if (height > CARRIER_NEAR / 2 || height < -UNDERSIDE || !about.contains(p)) return false;
    return std::any_of(foot.begin(), foot.end(), [&](const Eigen::Vector3f& q) {
      return up.cross(p - q).norm() < CARRIER_NEAR;
    });
  };
  int under = 0;
  for (std::size_t k = 0; k < parts.size(); ++k)
    for (std::size_t i = 0; i < parts[k].size(); ++i) {
      under += !explained.at(k, i) && isUnder(parts[k].points[i]);
      if (under == MIN_CARRIER_POINTS) return true;
    }
  return false;
}

}  // namespace

double liftOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
              const std::vector<Surface>& parts, const Marks& explained,
              const Observations& observations, const std::vector<Table>& tables) {
  if (tables.empty()) return 0;
  const Eigen::Isometry3f T = T_camera_object.cast<float>();
  std::vector<Eigen::Vector3f> surface;
  for (const auto& p : index.sparse(model).surface.points) surface.push_back(T * p);
  const Table& table = tables[tableUnder(tables, centroidOf(surface))];
  const double lowest = lowestAbove(table, T_camera_object, index.models()[model].surface.points);
  return isCarried(surface, lowest, parts, explained, observations, table) ? 0 : lowest;
}

}  // namespace tabletop_perception
