#include "pose_jitter.h"

#include <algorithm>
#include <cstddef>

#include <Eigen/Eigenvalues>

namespace tabletop_perception::tools {
namespace {

Eigen::Quaterniond meanRotation(const std::vector<Eigen::Isometry3d>& poses) {
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (const auto& pose : poses) {
    const Eigen::Vector4d q = Eigen::Quaterniond(pose.linear()).coeffs();
    sum += q * q.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(sum);
  return Eigen::Quaterniond(Eigen::Vector4d(solver.eigenvectors().col(3)));
}

}  // namespace

Spread spreadOf(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  Spread spread;
  for (const double value : values) spread.mean += value / static_cast<double>(values.size());
  spread.p95 = values[static_cast<std::size_t>(0.95 * static_cast<double>(values.size() - 1))];
  return spread;
}

Deviations deviationsFromMean(const std::vector<Eigen::Isometry3d>& poses) {
  Deviations deviations;
  if (poses.empty()) return deviations;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& pose : poses) middle += pose.translation() / static_cast<double>(poses.size());
  const Eigen::Quaterniond mean = meanRotation(poses);
  for (const auto& pose : poses) {
    deviations.shifts.push_back((pose.translation() - middle).norm());
    deviations.turns.push_back(mean.angularDistance(Eigen::Quaterniond(pose.linear())));
  }
  return deviations;
}

}  // namespace tabletop_perception::tools
