#include "tabletop_perception/logistic.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "clouds.h"

using namespace tabletop_perception;

TEST(Logistic, AConstantAloneIsTheLogOddsOfTheShare) {
  const LogisticFit fit = fitLogistic(Eigen::MatrixXd::Ones(4, 1), {true, true, true, false}, 0);
  EXPECT_TRUE(fit.converged);
  EXPECT_NEAR(fit.coefficients[0], std::log(3), 1e-6);
  EXPECT_NEAR(fit.loss, -(3 * std::log(0.75) + std::log(0.25)) / 4, 1e-9);
}

TEST(Logistic, FindsTheWeightsThatOutcomesWereDrawnWith) {
  const Eigen::Vector3d weights(-0.5, 2, -1);
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  Eigen::MatrixXd terms(20000, 3);
  std::vector<bool> outcomes;
  for (Eigen::Index i = 0; i < terms.rows(); ++i) {
    terms.row(i) << 1, normal(random), normal(random);
    outcomes.push_back(uniform(random) < logistic(terms.row(i).dot(weights)));
  }
  const LogisticFit fit = fitLogistic(terms, outcomes, 0);
  EXPECT_TRUE(fit.converged);
  EXPECT_LT((fit.coefficients - weights).norm(), 0.1);
}

TEST(Logistic, ThePriorKeepsTheWeightsFiniteWhereTheTermsTellAll) {
  Eigen::MatrixXd terms(4, 2);
  terms << 1, -2, 1, -1, 1, 1, 1, 2;
  const LogisticFit fit = fitLogistic(terms, {false, false, true, true}, 0.01);
  EXPECT_TRUE(fit.converged);
  EXPECT_GT(fit.coefficients[1], 0);
  EXPECT_LT(fit.coefficients.norm(), 100);
}

TEST(Logistic, RefusesWhatCannotBeFitted) {
  const Eigen::MatrixXd terms = Eigen::MatrixXd::Ones(2, 1);
  EXPECT_EQ(clouds::refusalOf([&] { fitLogistic(terms, {true}, 0); }),
            "a fit needs a row of terms for each outcome, got 2 for 1");
  EXPECT_EQ(clouds::refusalOf([&] {
              fitLogistic(terms, {true, true}, 0);
            }),
            "a fit needs outcomes of both kinds, got 2 right of 2");
}
