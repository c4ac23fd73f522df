#include "stands_at_point.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/planar_surface.h"

namespace tabletop_perception {
namespace {

constexpr double SAME_HEIGHT = 0.005;  // of a point of a model and the one that is seen [m]
constexpr float SAME_NORMAL = 0.8f;    // cosine
constexpr double TOLERANCE = 0.008;    // of the picture [m]
constexpr double HIDDEN_COST = 0.5;    // of what is not seen, to what is
constexpr double MIN_PROMISE = 0.2;
constexpr int MOST_OF_ONE = 3;          // poses of one model
constexpr double SAME_ANGLE = 0.3;      // candidates nearer than this [rad]
constexpr double SAME_DISTANCE = 0.02;  // and this are one [m]

bool samePose(const Candidate& a, const Candidate& b) {
  const Eigen::Isometry3d motion = a.T_camera_object.inverse() * b.T_camera_object;
  return a.name == b.name && motion.translation().norm() < SAME_DISTANCE &&
         angleOf(motion.linear()) < SAME_ANGLE;
}

/// How much more the picture shows of a model than what it hides or sees through.
double promiseOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                 const Observation& observation) {
  const Agreement agreement =
      agreementOf(index, model, T_camera_object, PlanarSurface(), observation, TOLERANCE);
  return agreement.visible - agreement.violation - HIDDEN_COST * agreement.hidden;
}

}  // namespace

std::vector<Candidate> standsAt(const Eigen::Vector3f& point, const Eigen::Vector3f& normal,
                                const Observation& observation, const ModelIndex& index, int most) {
  std::vector<Candidate> all;
  if (!observation.table || !observation.projection) return all;
  const Table& table = *observation.table;
  const double height = heightAbove(table, point);
  const Eigen::Vector3d seen = point.cast<double>();
  for (std::size_t m = 0; m < index.models().size(); ++m) {
    const SparseModel& model = index.sparse(static_cast<int>(m));
    for (const auto& stand : model.stands)
      for (const double yaw : stand.yaws) {
        Candidate candidate;
        candidate.name = index.models()[m].name;
        candidate.T_camera_object.linear() = table.T_camera_table.linear() *
                                             Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                                             stand.R_table_object;
        const Eigen::Matrix3d R = candidate.T_camera_object.linear();
        const auto& side = model.sideTowards((R.transpose() * -seen.normalized()).cast<float>());
        const Eigen::Vector3f facing = (R.transpose() * normal.cast<double>()).cast<float>();
        const Eigen::RowVector3d up = stand.R_table_object.row(2);
        for (const int i : side.visible) {
          const Eigen::Vector3d p = model.surface.points[i].cast<double>();
          if (std::abs(stand.origin_height + up * p - height) > SAME_HEIGHT ||
              model.surface.normals[i].dot(facing) < SAME_NORMAL)
            continue;
          candidate.T_camera_object.translation() = seen - R * p;
          candidate.promise =
              promiseOf(index, static_cast<int>(m), candidate.T_camera_object, observation);
          if (candidate.promise > MIN_PROMISE) all.push_back(candidate);
        }
      }
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const Candidate& a, const Candidate& b) { return a.promise > b.promise; });
  std::vector<Candidate> kept;
  std::map<std::string, int> counts;
  for (const auto& candidate : all) {
    if (static_cast<int>(kept.size()) == most) break;
    int& count = counts[candidate.name];
    if (count == MOST_OF_ONE || std::any_of(kept.begin(), kept.end(), [&](const Candidate& other) {
          return samePose(other, candidate);
        }))
      continue;
    ++count;
    kept.push_back(candidate);
  }
  return kept;
}

}  // namespace tabletop_perception
