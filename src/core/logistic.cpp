#include "tabletop_perception/logistic.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include <Eigen/Cholesky>

namespace tabletop_perception {
namespace {

constexpr int MAX_STEPS = 100;
constexpr int MAX_HALVINGS = 30;
constexpr double SMALL_GAIN = 1e-9;  // of the loss, in outcomes

/// -ln of the probability of an outcome.
double lossOf(double log_odds, bool outcome) {
  const double wrong = outcome ? -log_odds : log_odds;
  return wrong > 0 ? wrong + std::log1p(std::exp(-wrong)) : std::log1p(std::exp(wrong));
}

double lossOf(const Eigen::VectorXd& log_odds, const std::vector<bool>& outcomes) {
  double sum = 0;
  for (std::size_t i = 0; i < outcomes.size(); ++i) sum += lossOf(log_odds[i], outcomes[i]);
  return sum;
}

}  // namespace

double logistic(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }

LogisticFit fitLogistic(const Eigen::MatrixXd& terms, const std::vector<bool>& outcomes,
                        double prior) {
  if (terms.rows() != static_cast<Eigen::Index>(outcomes.size()))
    throw std::invalid_argument("a fit needs a row of terms for each outcome, got " +
                                std::to_string(terms.rows()) + " for " +
                                std::to_string(outcomes.size()));
  const auto right = std::count(outcomes.begin(), outcomes.end(), true);
  if (right == 0 || right == terms.rows())
    throw std::invalid_argument("a fit needs outcomes of both kinds, got " + std::to_string(right) +
                                " right of " + std::to_string(outcomes.size()));
  LogisticFit fit;
  Eigen::VectorXd c = Eigen::VectorXd::Zero(terms.cols());
  const auto costOf = [&](const Eigen::VectorXd& at) {
    return lossOf(terms * at, outcomes) + prior * at.squaredNorm() / 2;
  };
  double cost = costOf(c);
  for (int step = 0; step < MAX_STEPS && !fit.converged; ++step) {
    const Eigen::VectorXd p = (terms * c).unaryExpr(&logistic);
    Eigen::VectorXd missing = -p;
    for (std::size_t i = 0; i < outcomes.size(); ++i) missing[i] += outcomes[i];
    const Eigen::VectorXd weights = (p.array() * (1 - p.array())).max(1e-12);
    Eigen::MatrixXd curvature = terms.transpose() * weights.asDiagonal() * terms;
    curvature.diagonal().array() += prior + 1e-9;
    Eigen::VectorXd move = curvature.ldlt().solve(terms.transpose() * missing - prior * c);
    double moved = costOf(c + move);
    for (int i = 0; i < MAX_HALVINGS && moved > cost; ++i) moved = costOf(c + (move /= 2));
    fit.converged = cost - moved < SMALL_GAIN;
    if (moved <= cost) c += move, cost = moved;
  }
  fit.coefficients = c;
  fit.loss = lossOf(terms * c, outcomes) / static_cast<double>(outcomes.size());
  return fit;
}

}  // namespace tabletop_perception
