#include "tabletop_perception/uncertainty.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "icp_pairs.h"

namespace tabletop_perception {
namespace {

/// Least share of a direction in the normal equations, of those that all points would give; less
/// comes from the noise of the model's normals, and refinePose holds such directions where they
/// are.
constexpr double MIN_SHARE = 0.0033;
constexpr double FREE_SIZE = 2;       // deviation of a free direction, in sizes of the object
constexpr double LEAST_ERROR = 5e-5;  // of a model's own points [m]
constexpr double LEAST_SIZE = 0.001;  // of an object [m]

/// What the correspondences of a pose look like, in the object's frame.
struct Residuals {
  int count = 0;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double size = 0;         // RMS distance of the points from their middle [m]
  double variance = 0;     // of the distances from the tangent planes [m^2]
  double correlation = 0;  // of consecutive ones, as far as it is not chance
};

Residuals residualsOf(const IcpPairs& pairs) {
  Residuals residuals;
  double squares = 0, before = 0, products = 0, spread = 0;
  pairs.visitKept([&](const Correspondences& block, int i, const PlanarBlock&) {
    const Eigen::Vector3d p(block.x[i], block.y[i], block.z[i]);
    const double off =
        block.dx[i] * block.nx[i] + block.dy[i] * block.ny[i] + block.dz[i] * block.nz[i];
    ++residuals.count;
    residuals.middle += p;
    spread += p.squaredNorm();
    squares += off * off;
    products += off * before;
    before = off;
  });
  const double n = std::max(1, residuals.count);
  residuals.middle /= n;
  residuals.size =
      std::sqrt(std::max(LEAST_SIZE * LEAST_SIZE, spread / n - residuals.middle.squaredNorm()));
  residuals.variance = std::max(squares / n, LEAST_ERROR * LEAST_ERROR);
  residuals.correlation =
      std::clamp(products / std::max(squares, 1e-12) - 2 / std::sqrt(n), 0.0, 1.0);
  return residuals;
}

/// Takes a motion of the cluster in the object's frame (a turn about `middle` in units of `size`,
/// then a shift [m]) to the error of the object's pose: shift and turn in the camera's frame.
Matrix6d toCamera(const Residuals& residuals, const Eigen::Isometry3d& T_camera_object) {
  const Eigen::Matrix3d R = T_camera_object.linear();
  const Eigen::Vector3d& c = residuals.middle;
  Eigen::Matrix3d cross;  // times a turn: how the origin moves when it is about the middle
  cross << 0, -c.z(), c.y(), c.z(), 0, -c.x(), -c.y(), c.x(), 0;
  Matrix6d J;
  J << R * cross / residuals.size, R, R / residuals.size, Eigen::Matrix3d::Zero();
  return J;
}

}  // namespace

PoseUncertainty uncertaintyOf(const PlanarSurface& cluster, const NearestGrid& model,
                              const Eigen::Isometry3d& T_camera_object,
                              const RefineOptions& options) {
  IcpPairs pairs(cluster);
  pairs.find(model, T_camera_object.inverse(), options.max_distance, 1);
  const Residuals residuals = residualsOf(pairs);
  Vector6d scale;  // a turn of 1 moves points as far as a shift of 1, then
  scale << Eigen::Vector3d::Constant(1 / residuals.size), Eigen::Vector3d::Ones();
  const Matrix6d A = scale.asDiagonal() *
                     normalEquations(pairs, residuals.middle, "point_to_plane").A *
                     scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> directions(A);

  PoseUncertainty uncertainty;
  const double independent = residuals.variance * (1 - residuals.correlation);
  const double common = residuals.variance * residuals.correlation;
  Vector6d variances;
  for (int k = 0; k < 6; ++k) {
    const double information = std::max(0.0, directions.eigenvalues()[k]);
    const bool is_free = information <= MIN_SHARE * residuals.count;
    uncertainty.free_directions += is_free;
    variances[k] =
        is_free ? std::pow(FREE_SIZE * residuals.size, 2) : independent / information + common;
  }
  const Matrix6d J = toCamera(residuals, T_camera_object) * directions.eigenvectors();
  uncertainty.covariance = J * variances.asDiagonal() * J.transpose();
  return uncertainty;
}

Matrix6d turnedCovariance(const Matrix6d& covariance, const Eigen::Matrix3d& R_target_camera) {
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = R_target_camera;
  return turn * covariance * turn.transpose();
}

}  // namespace tabletop_perception
