#include "free_turn.h"

#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Eigenvalues>

#include "tabletop_perception/uncertainty.h"

namespace tabletop_perception {
namespace {

constexpr double NEAR = 0.006;                // of a point that a pose rests on [m]
constexpr double STEP = 10 * M_PI / 180;      // between the turns that are tried [rad]
constexpr double MIN_GAIN = 0.02;             // of agreement, to be turned
constexpr double MIN_TURN_SHARE = 0.9;        // of a free direction that is a turn, not a shift
constexpr double EXPLAINS_EVERYTHING = 0.99;  // of the points: no turn explains more
constexpr double CLEARER = 2;  // standard deviations of a count of pixels by which one is less

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

/// The angle at which a score is largest, if it gains `least` over no turn at all; else 0.
template <typename Score>
double bestAngle(double least, const Score& scoreAt) {
  double most = scoreAt(0) + least, best = 0;
  for (double angle = STEP; angle < 2 * M_PI - STEP / 2; angle += STEP) {
    const double score = scoreAt(angle);
    if (score < most) continue;
    most = score;
    best = angle;
  }
  return best;
}

/// The angle at which the outline is off the least, from a turn by `angle` on, if that is clearer
/// and the points agree nearly as well.
template <typename PoseAt, typename Score>
double clearestAngle(const SeenOutline& seen, double angle, const PoseAt& poseAt,
                     const Score& scoreAt) {
  const double least_score = scoreAt(angle) - MIN_GAIN;
  const int at_hand = seen.offAt(poseAt(angle)).pixels;
  int least = at_hand;
  double best = angle;
  const auto look = [&](double other) {
    const int pixels = seen.offAt(poseAt(other)).pixels;
    if (pixels >= least || scoreAt(other) < least_score) return;
    least = pixels;
    best = other;
  };
  for (double other = angle + STEP; other < angle + 2 * M_PI - STEP / 2; other += STEP) look(other);
  if (at_hand - least < CLEARER * std::sqrt(at_hand + least)) return angle;
  for (const double step : {STEP / 2, STEP / 4}) {
    const double middle = best;
    look(middle - step);
    look(middle + step);
  }
  return best;
}

}  // namespace

Eigen::Isometry3d bestFreeTurn(const ModelIndex& index, int model,
                               const Eigen::Isometry3d& T_camera_object,
                               const PlanarSurface& points, const Observation& observation,
                               const SeenOutline* outline, double tolerance,
                               const RefineOptions& refine) {
  if (index.models()[model].symmetry.continuous()) return T_camera_object;
  RefineOptions fine = refine;
  fine.start_distance = fine.max_distance = NEAR;
  const NearestGrid& grid = index.grid(model);
  const auto turn =
      freeTurn(uncertaintyOf(points, grid, T_camera_object, fine), T_camera_object.translation());
  if (!turn) return T_camera_object;
  const auto poseAt = [&](double angle) -> Eigen::Isometry3d {
    return turn->by(angle) * T_camera_object;
  };
  const auto agreementAt = [&](double angle) {
    return agreementOf(index, model, poseAt(angle), points, observation, tolerance);
  };
  const auto scoreAt = [&](double angle) { return agreementAt(angle).shapeScore(tolerance); };

  double angle = 0;
  if (agreementAt(0).explained <= EXPLAINS_EVERYTHING) angle = bestAngle(MIN_GAIN, scoreAt);
  if (outline) angle = clearestAngle(*outline, angle, poseAt, scoreAt);
  if (angle == 0) return T_camera_object;
  const auto alignment = refinePose(points, grid, poseAt(angle), fine);
  return alignment ? alignment->T_camera_object : poseAt(angle);
}

}  // namespace tabletop_perception
