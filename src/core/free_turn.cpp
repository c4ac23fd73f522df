#include "free_turn.h"

#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

#include "tabletop_perception/uncertainty.h"

namespace tabletop_perception {
namespace {

constexpr double NEAR = 0.006;                // of a point that a pose rests on [m]
constexpr double STEP = 10 * M_PI / 180;      // between the turns that are tried [rad]
constexpr double MIN_GAIN = 0.02;             // of agreement, to be turned
constexpr double MIN_TURN_SHARE = 0.9;        // of a free direction that is a turn, not a shift
constexpr double EXPLAINS_EVERYTHING = 0.99;  // of the points: no turn explains more

/// A turn about an axis in the camera's frame.
struct Turn {
  Eigen::Vector3d axis;   ///< unit direction
  Eigen::Vector3d point;  ///< on the axis [m]

  Eigen::Isometry3d by(double angle) const {
    return Eigen::Translation3d(point) * Eigen::AngleAxisd(angle, axis) *
           Eigen::Translation3d(-point);
  }
};

/// The turn of which the points say nothing, if that is the one thing that they leave free.
std::optional<Turn> freeTurn(const PoseUncertainty& uncertainty, const Eigen::Vector3d& origin) {
  if (uncertainty.free_directions != 1) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> directions(
      uncertainty.covariance);
  const Eigen::Matrix<double, 6, 1> widest = directions.eigenvectors().col(5);
  const Eigen::Vector3d shift = widest.head<3>(), turn = widest.tail<3>();
  if (turn.squaredNorm() < MIN_TURN_SHARE) return std::nullopt;
  // The origin shifts by turn x (origin - point).
  return Turn{turn.normalized(), origin + turn.cross(shift) / turn.squaredNorm()};
}

}  // namespace

Eigen::Isometry3d bestFreeTurn(const ModelIndex& index, int model,
                               const Eigen::Isometry3d& T_camera_object,
                               const PlanarSurface& points, const Observation& observation,
                               double tolerance, const RefineOptions& refine) {
  if (index.models()[model].symmetry.continuous()) return T_camera_object;
  const auto agreementAt = [&](const Eigen::Isometry3d& pose) {
    return agreementOf(index, model, pose, points, observation, tolerance);
  };
  const Agreement at_hand = agreementAt(T_camera_object);
  if (at_hand.explained > EXPLAINS_EVERYTHING) return T_camera_object;
  RefineOptions fine = refine;
  fine.start_distance = fine.max_distance = NEAR;
  const NearestGrid& grid = index.grid(model);
  const auto turn =
      freeTurn(uncertaintyOf(points, grid, T_camera_object, fine), T_camera_object.translation());
  if (!turn) return T_camera_object;

  double most = at_hand.shapeScore(tolerance) + MIN_GAIN;
  std::optional<double> best;
  for (double angle = STEP; angle < 2 * M_PI - STEP / 2; angle += STEP) {
    const double score = agreementAt(turn->by(angle) * T_camera_object).shapeScore(tolerance);
    if (score < most) continue;
    most = score;
    best = angle;
  }
  if (!best) return T_camera_object;
  const Eigen::Isometry3d turned = turn->by(*best) * T_camera_object;
  const auto alignment = refinePose(points, grid, turned, fine);
  return alignment ? alignment->T_camera_object : turned;
}

}  // namespace tabletop_perception
