#include "polish_pose.h"

#include "near_model.h"
#include "pixel_votes.h"

namespace tabletop_perception {
namespace {

constexpr double REACH = 0.015;            // of points about the model that are looked at [m]
constexpr double DISTANCE = 0.006;         // of those that count [m]
constexpr std::size_t MAX_POINTS = 10000;  // more hardly make it better

/// Whether the picture, if there is one, speaks against a pose more than against another.
bool speaksAgainst(const Observation& observation, const Surface& model,
                   const Eigen::Isometry3d& T_camera_model,
                   const Eigen::Isometry3d& T_camera_other) {
  return observation.projection &&
         votesAgainst(observation, model, T_camera_model) >
             votesAgainst(observation, model, T_camera_other) + VOTES_ALIKE;
}

}  // namespace

PolishedPose polishPose(const ModelIndex& index, int model,
                        const Eigen::Isometry3d& T_camera_object,
                        const std::vector<Eigen::Vector3f>& points, const Observation& observation,
                        const RefineOptions& refine) {
  const PlanarSurface source(
      pointsNearModel(index, model, T_camera_object, points, REACH, MAX_POINTS));
  RefineOptions fine = refine;
  fine.start_distance = fine.max_distance = DISTANCE;
  const NearestGrid& grid = index.grid(model);
  const auto alignment = refinePose(source, grid, T_camera_object, fine);
  PolishedPose polished;
  polished.T_camera_object = T_camera_object;
  if (alignment && !speaksAgainst(observation, index.models()[model].surface,
                                  alignment->T_camera_object, T_camera_object))
    polished.T_camera_object = alignment->T_camera_object;
  polished.uncertainty = uncertaintyOf(source, grid, polished.T_camera_object, fine);
  return polished;
}

}  // namespace tabletop_perception
