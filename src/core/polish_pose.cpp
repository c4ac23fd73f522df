#include "polish_pose.h"

#include "near_model.h"

namespace tabletop_perception {
namespace {

constexpr double REACH = 0.015;            // of points about the model that are looked at [m]
constexpr double DISTANCE = 0.006;         // of those that count [m]
constexpr std::size_t MAX_POINTS = 10000;  // more hardly make it better

}  // namespace

PolishedPose polishPose(const ModelIndex& index, int model,
                        const Eigen::Isometry3d& T_camera_object,
                        const std::vector<Eigen::Vector3f>& points, const RefineOptions& refine) {
  const PlanarSurface source(
      pointsNearModel(index, model, T_camera_object, points, REACH, MAX_POINTS));
  RefineOptions fine = refine;
  fine.start_distance = fine.max_distance = DISTANCE;
  const NearestGrid& grid = index.grid(model);
  const auto alignment = refinePose(source, grid, T_camera_object, fine);
  PolishedPose polished;
  polished.T_camera_object = alignment ? alignment->T_camera_object : T_camera_object;
  polished.uncertainty = uncertaintyOf(source, grid, polished.T_camera_object, fine);
  return polished;
}

}  // namespace tabletop_perception
