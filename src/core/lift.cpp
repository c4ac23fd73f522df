#include "lift.h"

#include <algorithm>

#include "lowest_point.h"

namespace tabletop_perception {
namespace {

constexpr double UNDERSIDE = 0.03;     // of an object, about its lowest point [m]
constexpr double CARRIER_NEAR = 0.01;  // what carries an object lies no farther beside it [m]
constexpr int MIN_CARRIER_POINTS = 10;

/// Whether points that an object does not explain lie right under it. `surface`: of the object;
/// `lowest`: height of its lowest point [m].
bool isCarried(const std::vector<Eigen::Vector3f>& surface, double lowest,
               const std::vector<Surface>& parts, const Marks& explained, const Table& table) {
  if (lowest < UNDERSIDE) return false;
  const Eigen::Vector3f up = table.plane.head<3>().cast<float>();
  std::vector<Eigen::Vector3f> foot;
  Eigen::AlignedBox3f about;  // what carries it lies in there
  for (const auto& p : surface) {
    if (heightAbove(table, p) >= lowest + UNDERSIDE) continue;
    foot.push_back(p);
    about.extend(p);
  }
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
              const std::vector<Table>& tables) {
  if (tables.empty()) return 0;
  const Eigen::Isometry3f T = T_camera_object.cast<float>();
  std::vector<Eigen::Vector3f> surface;
  for (const auto& p : index.sparse(model).surface.points) surface.push_back(T * p);
  const Table& table = tables[tableUnder(tables, centroidOf(surface))];
  const double lowest = lowestAbove(table, T_camera_object, index.models()[model].surface.points);
  return isCarried(surface, lowest, parts, explained, table) ? 0 : lowest;
}

}  // namespace tabletop_perception
