#include "fit_score.h"

#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "evaluate.h"
#include "tabletop_perception/logistic.h"

namespace tabletop_perception::tools {
namespace {

constexpr double PRIOR = 0.01;     // keeps the weights finite, see fitLogistic
constexpr double SURE_TURN = 0.9;  // results less sure say little about the other evidence
constexpr double LEAST_PROBABILITY = 1e-9;

/// Mean negative log likelihood of the results under the scores they have.
double lossOfScores(const std::vector<double>& scores, const std::vector<bool>& right) {
  double sum = 0;
  for (std::size_t i = 0; i < scores.size(); ++i)
    sum -= std::log(std::max(LEAST_PROBABILITY, right[i] ? scores[i] : 1 - scores[i]));
  return sum / static_cast<double>(scores.size());
}

}  // namespace

void printScoreFit(const std::vector<PosedScene>& scenes, bool json) {
  std::vector<Eigen::VectorXd> rows;
  std::vector<bool> right;
  std::vector<double> scores;
  for (const auto& scene : scenes)
    for (std::size_t r = 0; r < scene.results.size(); ++r) {
      const auto& result = scene.results[r];
      if (!result.evidence || result.evidence->turn < SURE_TURN) continue;
      rows.push_back(scoreTerms(*result.evidence));
      right.push_back(scene.right(r));
      scores.push_back(probabilityOf(*result.evidence));
    }
  if (rows.empty()) throw std::invalid_argument("no result with a name says its evidence");
  Eigen::MatrixXd terms(rows.size(), rows.front().size());
  for (std::size_t i = 0; i < rows.size(); ++i) terms.row(static_cast<Eigen::Index>(i)) = rows[i];
  const LogisticFit fit = fitLogistic(terms, right, PRIOR);
  const auto names = scoreTermNames();
  const double loss = lossOfScores(scores, right);
  if (json) {
    nlohmann::ordered_json weights;
    for (std::size_t t = 0; t < names.size(); ++t) weights[names[t]] = fit.coefficients[t];
    std::printf("%s\n", nlohmann::ordered_json({{"results", right.size()},
                                                {"loss", loss},
                                                {"fitted_loss", fit.loss},
                                                {"weights", weights}})
                            .dump()
                            .c_str());
    return;
  }
  std::vector<std::vector<std::string>> lines;
  for (std::size_t t = 0; t < names.size(); ++t)
    lines.push_back({names[t], formatted(fit.coefficients[t], 1, 3)});
  lines.push_back({"results", std::to_string(right.size())});
  lines.push_back({"loss of the scores now", formatted(loss, 1, 4)});
  lines.push_back({"and of these weights", formatted(fit.loss, 1, 4)});
  printColumns(lines);
}

}  // namespace tabletop_perception::tools
