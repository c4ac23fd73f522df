#include "tabletop_perception/revolution.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

namespace tabletop_perception {
namespace {

constexpr int ROUNDS = 20;           // of weighting
constexpr double NEAR = 0.004;       // of a normal that meets the axis [m]
constexpr double MIN_SLANT = 0.3;    // sine to the axis of a normal that says where it is
constexpr double MIN_SHARE = 0.75;   // of such normals, that meet it
constexpr std::size_t FEWEST = 100;  // of them
constexpr double LEAST_SPREAD = 1e-6;

/// How far the line of a normal passes by an axis, times the sine of their angle [m].
double missOf(const Axis& axis, const Eigen::Vector3d& p, const Eigen::Vector3d& n) {
  return axis.direction.dot((p - axis.point).cross(n));
}

/// The axis that the weighted normals miss least.
Axis fitted(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector3d>& normals,
            const std::vector<double>& weights) {
  // moment . n + direction . (p x n) is zero for a normal n at p that meets the axis.
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero(), B = A, C = A;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d m = points[i].cross(normals[i]);
    A += weights[i] * normals[i] * normals[i].transpose();
    B += weights[i] * normals[i] * m.transpose();
    C += weights[i] * m * m.transpose();
  }
  const Eigen::Matrix3d solved =
      (A + LEAST_SPREAD * A.trace() * Eigen::Matrix3d::Identity()).ldlt().solve(B);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> misses(C - B.transpose() * solved);
  Axis axis;
  axis.direction = misses.eigenvectors().col(0);
  axis.point = axis.direction.cross(Eigen::Vector3d(-solved * axis.direction));
  return axis;
}

}  // namespace

std::optional<Axis> axisOfMost(const Surface& surface) {
  if (surface.empty()) return std::nullopt;
  const Eigen::Vector3d middle = centroidOf(surface.points).cast<double>();
  std::vector<Eigen::Vector3d> points, normals;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    points.emplace_back(surface.points[i].cast<double>() - middle);
    normals.emplace_back(surface.normals[i].cast<double>());
  }
  std::vector<double> weights(points.size(), 1);
  Axis axis{};
  for (int round = 0; round < ROUNDS; ++round) {
    axis = fitted(points, normals, weights);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double miss = missOf(axis, points[i], normals[i]) / NEAR;
      weights[i] = 1 / (1 + miss * miss);
    }
  }
  std::size_t telling = 0, meeting = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double slant = axis.direction.cross(normals[i]).norm();
    if (slant < MIN_SLANT) continue;
    ++telling;
    meeting += std::abs(missOf(axis, points[i], normals[i])) < NEAR * slant;
  }
  if (telling < FEWEST || static_cast<double>(meeting) < MIN_SHARE * static_cast<double>(telling))
    return std::nullopt;
  axis.point += middle;
  return axis;
}

}  // namespace tabletop_perception
