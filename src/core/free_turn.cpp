#include "free_turn.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "lowest_point.h"
#include "pixel_votes.h"
#include "tabletop_perception/uncertainty.h"

namespace tabletop_perception {
namespace {

constexpr double NEAR = 0.006;             // of a point that a pose rests on [m]
constexpr int TURNS = 72;                  // that are tried
constexpr double STEP = 2 * M_PI / TURNS;  // between them [rad]
constexpr int AS_ONE = 2;                  // turns on each side of one that are as good
constexpr double CLEARER = 2;              // times as likely, to be turned
constexpr int FINE_TURNS = 5;              // that are tried about the best one
constexpr int ROUNDS = 2;                  // of turns and ICP
constexpr double MIN_GAIN = 0.02;          // of agreement, to be turned
constexpr double MAX_SINK = 0.008;         // of a turn, into the table [m]
constexpr double MIN_TURN_SHARE = 0.9;     // of a free direction that is a turn, not a shift

/// A turn about an axis in the camera's frame.
struct Turn {
  Eigen::Vector3d axis;   ///< unit direction
  Eigen::Vector3d point;  ///< on the axis [m]

  Eigen::Isometry3d by(double angle) const {
    return Eigen::Translation3d(point) * Eigen::AngleAxisd(angle, axis) *
           Eigen::Translation3d(-point);
  }
};

/// The turn about the axis of a model that is one of revolution but for a handle or so: the points
/// about it, a neighbour's among them, may hold on to a turn that is wrong.
std::optional<Turn> turnAboutAxis(const SparseModel& model,
                                  const Eigen::Isometry3d& T_camera_object) {
  if (!model.axis) return std::nullopt;
  return Turn{T_camera_object.linear() * model.axis->direction,
              T_camera_object * model.axis->point};
}

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

/// The angle at which a score is largest, if it gains MIN_GAIN over no turn at all; else 0.
template <typename Score>
double bestAngle(const Score& scoreAt) {
  double most = scoreAt(0) + MIN_GAIN, best = 0;
  for (int k = 1; k < TURNS; ++k) {
    const double score = scoreAt(k * STEP);
    if (score < most) continue;
    most = score;
    best = k * STEP;
  }
  return best;
}

/// The likelihoods of some turns, up to a factor, by the votes against them.
template <typename Votes>
std::vector<double> likelihoods(const Votes& votesAgainstAt, double first, double step, int turns) {
  std::vector<double> all;
  for (int k = 0; k < turns; ++k) all.push_back(-votesAgainstAt(first + k * step) / VOTES_ALIKE);
  const double most = *std::max_element(all.begin(), all.end());
  for (double& l : all) l = std::exp(l - most);
  return all;
}

/// The middle of the likeliest turns next to each other; none, 0, where that is not clearly
/// likelier than those about none: a handle that is hidden stays where it is hidden.
template <typename Votes>
double likeliestAngle(const Votes& votesAgainstAt) {
  const auto all = likelihoods(votesAgainstAt, 0, STEP, TURNS);
  const auto about = [&](int k) {
    double sum = 0;
    for (int other = k - AS_ONE; other <= k + AS_ONE; ++other) sum += all[(other + TURNS) % TURNS];
    return sum;
  };
  int best = 0;
  double most = about(0);
  for (int k = 1; k < TURNS; ++k) {
    const double sum = about(k);
    if (sum <= most || all[k] == 0) continue;
    most = sum;
    best = k;
  }
  return most > CLEARER * about(0) ? best * STEP : 0;
}

/// The mean of the likely turns about none.
template <typename Votes>
double likelyAngle(const Votes& votesAgainstAt) {
  const double step = 2 * STEP / (FINE_TURNS - 1);
  const auto near = likelihoods(votesAgainstAt, -STEP, step, FINE_TURNS);
  double sum = 0, angles = 0;
  for (int k = 0; k < FINE_TURNS; ++k) {
    sum += near[k];
    angles += near[k] * (k * step - STEP);
  }
  return angles / sum;
}

}  // namespace

Eigen::Isometry3d bestFreeTurn(const ModelIndex& index, int model,
                               const Eigen::Isometry3d& T_camera_object,
                               const PlanarSurface& points, const Observation& observation,
                               double tolerance, const RefineOptions& refine) {
  if (index.models()[model].symmetry.continuous()) return T_camera_object;
  RefineOptions fine = refine;
  fine.start_distance = fine.max_distance = NEAR;
  const NearestGrid& grid = index.grid(model);
  auto turn = turnAboutAxis(index.sparse(model), T_camera_object);
  if (!turn)
    turn =
        freeTurn(uncertaintyOf(points, grid, T_camera_object, fine), T_camera_object.translation());
  if (!turn) return T_camera_object;
  const auto alignedTo = [&](const Eigen::Isometry3d& pose) {
    const auto alignment = refinePose(points, grid, pose, fine);
    return alignment ? alignment->T_camera_object : pose;
  };
  if (!observation.projection) {
    const double angle = bestAngle([&](double some) {
      return agreementOf(index, model, turn->by(some) * T_camera_object, points, observation,
                         tolerance)
          .shapeScore(tolerance);
    });
    return angle == 0 ? T_camera_object : alignedTo(turn->by(angle) * T_camera_object);
  }
  const auto sinkAt = [&](const Eigen::Isometry3d& pose) {
    return observation.table ? sinkOf(*observation.table, pose, index.sparse(model).surface.points)
                             : 0;
  };
  const double deepest = std::max(MAX_SINK, sinkAt(T_camera_object));
  const auto votesAt = [&](const Eigen::Isometry3d& pose) {
    return sinkAt(pose) > deepest ? std::numeric_limits<double>::infinity()
                                  : votesAgainst(observation, index.models()[model].surface, pose);
  };
  const auto turned = [&](const Eigen::Isometry3d& pose, double angle) -> Eigen::Isometry3d {
    return turn->by(angle) * pose;
  };
  const double angle =
      likeliestAngle([&](double some) { return votesAt(turned(T_camera_object, some)); });
  if (angle == 0) return T_camera_object;
  Eigen::Isometry3d pose = turned(T_camera_object, angle);
  for (int round = 0; round < ROUNDS; ++round) {
    const Eigen::Isometry3d likely =
        turned(pose, likelyAngle([&](double some) { return votesAt(turned(pose, some)); }));
    const double against = votesAt(likely);
    if (std::isinf(against)) break;
    pose = likely;
    const Eigen::Isometry3d aligned = alignedTo(pose);
    if (votesAt(aligned) > against + VOTES_ALIKE) break;
    pose = aligned;
  }
  return pose;
}

}  // namespace tabletop_perception
