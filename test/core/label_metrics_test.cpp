#include "tabletop_perception/label_metrics.h"

#include <algorithm>
#include <numeric>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

namespace tabletop_perception {
namespace {

using Labels = std::vector<std::uint32_t>;

/// A scene as runs of points that share a truth and a result.
struct Scene {
  Labels truth, result;

  Scene& add(std::size_t points, std::uint32_t truth_label, std::uint32_t result_label) {
    truth.insert(truth.end(), points, truth_label);
    result.insert(result.end(), points, result_label);
    return *this;
  }
  LabelScore score() const { return scoreLabels(truth, result); }
};

double bestSumByTrying(const Eigen::MatrixXd& scores) {
  const bool tall = scores.rows() > scores.cols();
  const Eigen::MatrixXd wide = tall ? Eigen::MatrixXd(scores.transpose()) : scores;
  std::vector<int> order(wide.cols());
  std::iota(order.begin(), order.end(), 0);
  double best = -1e300;
  do {
    double sum = 0;
    for (int row = 0; row < wide.rows(); ++row) sum += wide(row, order[row]);
    best = std::max(best, sum);
  } while (std::next_permutation(order.begin(), order.end()));
  return best;
}

TEST(BestAssignment, reachesTheSumOfTryingEverything) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> size(1, 6);
  std::uniform_real_distribution<double> score(-1, 1);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::MatrixXd scores =
        Eigen::MatrixXd::NullaryExpr(size(random), size(random), [&] { return score(random); });
    const auto assignment = bestAssignment(scores);
    ASSERT_EQ(assignment.size(), static_cast<std::size_t>(scores.rows()));
    double sum = 0;
    std::vector<int> used(scores.cols(), 0);
    for (int row = 0; row < scores.rows(); ++row) {
      if (assignment[row] < 0) continue;
      sum += scores(row, assignment[row]);
      EXPECT_EQ(++used[assignment[row]], 1);
    }
    EXPECT_EQ(std::accumulate(used.begin(), used.end(), 0), std::min(scores.rows(), scores.cols()));
    EXPECT_NEAR(sum, bestSumByTrying(scores), 1e-12);
  }
}

TEST(BestAssignment, givesUpTheBestPairWhereTheSumGains) {
  Eigen::Matrix2d scores;
  scores << 0.9, 0.8,  //
      0.8, 0.1;
  EXPECT_EQ(bestAssignment(scores), (std::vector<int>{1, 0}));
}

TEST(BestAssignment, leavesEveryRowAloneWithoutColumns) {
  EXPECT_EQ(bestAssignment(Eigen::MatrixXd(2, 0)), (std::vector<int>{-1, -1}));
  EXPECT_TRUE(bestAssignment(Eigen::MatrixXd(0, 3)).empty());
}

TEST(LabelMetrics, aPerfectResultScoresOneWhateverItsNumbers) {
  const auto score =
      Scene().add(5000, 1, 1).add(1000, 20, 7).add(800, 30, 3).add(100, 0, 0).score();
  EXPECT_DOUBLE_EQ(score.best.precision(), 1);
  EXPECT_DOUBLE_EQ(score.best.recall(), 1);
  EXPECT_DOUBLE_EQ(score.best.f(), 1);
  EXPECT_DOUBLE_EQ(score.table_iou, 1);
}

TEST(LabelMetrics, countsAsWorkedOutByHand) {
  // Object 1: 1000 points, 900 in segment 2 (1000 points). Object 2: 500 points, 400 in segment 3
  // (600 points). Segment 4: 200 points of the table. Table: 5000 points, 4700 of them called so,
  // beside 100 points of object 1.
  const auto score = Scene()
                         .add(900, 20, 2)
                         .add(100, 20, 1)
                         .add(400, 30, 3)
                         .add(100, 30, 2)
                         .add(200, 3, 3)
                         .add(4600, 1, 1)
                         .add(100, 2, 1)
                         .add(200, 1, 4)
                         .score();
  ASSERT_EQ(score.best.objects.size(), 2u);
  EXPECT_DOUBLE_EQ(score.best.precision(), 1300.0 / 1800);
  EXPECT_DOUBLE_EQ(score.best.recall(), 1300.0 / 1500);
  EXPECT_DOUBLE_EQ(score.best.f(), 2 * 1300.0 / 3300);
  EXPECT_EQ(score.best.objects[0].segment, 2u);
  EXPECT_DOUBLE_EQ(score.best.objects[0].iou(), 900.0 / 1100);
  EXPECT_EQ(score.best.objects[1].segment, 3u);
  EXPECT_DOUBLE_EQ(score.best.objects[1].iou(), 400.0 / 700);
  EXPECT_DOUBLE_EQ(score.table_iou, 4700.0 / 5200);
}

TEST(LabelMetrics, oneSegmentOverTwoObjectsIsMatchedOnce) {
  const auto score = Scene().add(600, 20, 2).add(400, 30, 2).score();
  EXPECT_EQ(score.best.objects[0].segment, 2u);
  EXPECT_EQ(score.best.objects[1].segment, 0u);
  EXPECT_DOUBLE_EQ(score.best.objects[1].iou(), 0);
  EXPECT_DOUBLE_EQ(score.best.f(), 0.6);
}

TEST(LabelMetrics, eachObjectIsReadAsTheResultHasIt) {
  // Object 1 in one segment, object 2 in a segment per part.
  const auto score =
      Scene().add(1000, 20, 2).add(500, 21, 2).add(700, 30, 3).add(400, 31, 4).score();
  EXPECT_DOUBLE_EQ(score.best.f(), 1);
  ASSERT_EQ(score.best.objects.size(), 3u);
  EXPECT_EQ(score.best.objects[0].part, 0u);
  EXPECT_EQ(score.best.objects[1].part, 30u);
  EXPECT_EQ(score.best.objects[2].part, 31u);
  EXPECT_DOUBLE_EQ(score.whole.f(), 2200.0 / 2600);
  EXPECT_DOUBLE_EQ(score.parts.f(), 2100.0 / 2600);
  EXPECT_EQ(score.whole.objects.size(), 2u);
  EXPECT_EQ(score.parts.objects.size(), 4u);
}

TEST(LabelMetrics, anObjectThatWasMissedCountsOnce) {
  const auto score = Scene().add(1000, 20, 0).add(500, 21, 0).add(400, 30, 2).score();
  EXPECT_EQ(score.best.objects.size(), 2u);
  EXPECT_EQ(score.parts.objects.size(), 3u);
}

TEST(LabelMetrics, partsUnderThreeHundredPointsAreNoObjects) {
  const auto score = Scene().add(300, 20, 2).add(299, 21, 3).add(299, 30, 4).score();
  ASSERT_EQ(score.parts.objects.size(), 1u);
  EXPECT_EQ(score.parts.objects[0].points, 300u);
  EXPECT_DOUBLE_EQ(score.best.recall(), 1);
  EXPECT_DOUBLE_EQ(score.best.precision(), 300.0 / 898);
}

TEST(LabelMetrics, pointsWithoutATruthDoNotCount) {
  const auto score = Scene().add(500, 20, 2).add(500, 1, 1).add(900, 0, 2).add(900, 0, 1).score();
  EXPECT_DOUBLE_EQ(score.best.f(), 1);
  EXPECT_DOUBLE_EQ(score.table_iou, 1);
}

TEST(LabelMetrics, nothingFoundScoresZeroAndNothingToFindOne) {
  const auto missed = Scene().add(500, 20, 0).add(500, 1, 0).score();
  EXPECT_DOUBLE_EQ(missed.best.precision(), 0);
  EXPECT_DOUBLE_EQ(missed.best.recall(), 0);
  EXPECT_DOUBLE_EQ(missed.best.f(), 0);
  EXPECT_DOUBLE_EQ(missed.table_iou, 0);

  const auto empty = Scene().add(500, 0, 0).score();
  EXPECT_DOUBLE_EQ(empty.best.precision(), 1);
  EXPECT_DOUBLE_EQ(empty.best.recall(), 1);
  EXPECT_DOUBLE_EQ(empty.best.f(), 1);
  EXPECT_DOUBLE_EQ(empty.table_iou, 1);

  const auto invented = Scene().add(500, 1, 2).score();
  EXPECT_DOUBLE_EQ(invented.best.precision(), 0);
  EXPECT_DOUBLE_EQ(invented.best.recall(), 0);
  EXPECT_DOUBLE_EQ(invented.best.f(), 0);
}

TEST(LabelMetrics, theBestReadingIsNeverBelowAPureOne) {
  std::mt19937 random(3);
  std::uniform_int_distribution<std::uint32_t> object(2, 5), part(0, 2), segment(0, 7);
  std::uniform_int_distribution<std::size_t> points(100, 900);
  for (int trial = 0; trial < 100; ++trial) {
    Scene scene;
    for (int run = 0; run < 25; ++run)
      scene.add(points(random), 10 * object(random) + part(random), segment(random));
    const auto score = scene.score();
    EXPECT_GE(score.best.overlap, score.whole.overlap);
    EXPECT_GE(score.best.overlap, score.parts.overlap);
    EXPECT_EQ(score.best.truth_points, score.whole.truth_points);
    EXPECT_EQ(score.best.truth_points, score.parts.truth_points);
  }
}

TEST(LabelMetrics, aSummaryIsTheMeanOfScenesAndThePoolOfObjects) {
  const auto good = Scene().add(500, 20, 2).add(500, 30, 3).add(500, 1, 1).score();
  // 750 of 1000 points are an IoU of exactly 0.75: found. Half the table is missing.
  const auto fair = Scene().add(750, 20, 2).add(250, 20, 0).add(400, 1, 1).add(400, 1, 0).score();
  const auto poor = Scene().add(740, 20, 2).add(260, 20, 0).add(400, 1, 1).score();
  const auto summary = summarize({good, fair, poor});
  EXPECT_EQ(summary.scenes, 3u);
  EXPECT_DOUBLE_EQ(summary.best.precision, 1);
  EXPECT_DOUBLE_EQ(summary.best.recall, (1 + 0.75 + 0.74) / 3);
  EXPECT_DOUBLE_EQ(summary.best.f, (1 + 1500.0 / 1750 + 1480.0 / 1740) / 3);
  EXPECT_EQ(summary.best.objects, 4u);
  EXPECT_EQ(summary.best.found, 3u);
  EXPECT_EQ(summary.best.foundShare(), 0.75);
  EXPECT_DOUBLE_EQ(summary.table_iou, 2.5 / 3);
  EXPECT_DOUBLE_EQ(summary.worst_table_iou, 0.5);
  EXPECT_EQ(summarize({Scene().add(500, 1, 1).score()}).best.foundShare(), std::nullopt);
}

TEST(LabelMetrics, refusesCloudsOfDifferentSizeAndNoScenes) {
  EXPECT_THROW(scoreLabels(Labels(4, 1), Labels(3, 1)), std::invalid_argument);
  EXPECT_THROW(summarize({}), std::invalid_argument);
}

}  // namespace
}  // namespace tabletop_perception
