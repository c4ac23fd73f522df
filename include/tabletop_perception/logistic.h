#pragma once

#include <vector>

#include <Eigen/Core>

namespace tabletop_perception {

/// Coefficients of a logistic regression, and what they are worth.
struct LogisticFit {
  Eigen::VectorXd coefficients;  ///< one per column of the terms
  double loss = 0;  ///< mean negative log likelihood of the outcomes, without the prior
  bool converged = false;
};

/// The coefficients c that make the outcomes most likely where `P(true) = 1 / (1 + exp(-terms c))`,
/// by Newton's method. `terms`: a row per outcome. `prior`: weight of the squares of the
/// coefficients, in units of outcomes; it keeps them finite where the terms tell the outcomes
/// apart without exception. Throws std::invalid_argument unless there are as many rows as outcomes,
/// and some of either outcome.
LogisticFit fitLogistic(const Eigen::MatrixXd& terms, const std::vector<bool>& outcomes,
                        double prior);

/// 1 / (1 + exp(-odds))
double logistic(double log_odds);

}  // namespace tabletop_perception
