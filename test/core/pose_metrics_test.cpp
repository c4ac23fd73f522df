#include "tabletop_perception/pose_metrics.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

namespace tabletop_perception {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double DEGREE = M_PI / 180;
constexpr double EPSILON = 1e-6;  // [m], of points in single precision

/// A closed box of 6 x 8 x 24 cm, so with a diameter of 26 cm.
Mesh boxMesh(const Eigen::Vector3f& middle = Eigen::Vector3f::Zero()) {
  Mesh mesh;
  for (const float x : {-0.03f, 0.03f})
    for (const float y : {-0.04f, 0.04f})
      for (const float z : {-0.12f, 0.12f})
        mesh.vertices.push_back(middle + Eigen::Vector3f(x, y, z));
  mesh.faces = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5}, {0, 5, 1},
                {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  return mesh;
}

/// A closed can about z with a radius of 4 cm and a height of 10 cm, of 48 sides.
Mesh canMesh() {
  constexpr int SIDES = 48;
  Mesh mesh;
  for (int i = 0; i < SIDES; ++i) {
    const float angle = 2 * static_cast<float>(M_PI) * i / SIDES;
    for (const float z : {-0.05f, 0.05f})
      mesh.vertices.emplace_back(0.04f * std::cos(angle), 0.04f * std::sin(angle), z);
  }
  mesh.vertices.emplace_back(0, 0, -0.05f);
  mesh.vertices.emplace_back(0, 0, 0.05f);
  for (int i = 0; i < SIDES; ++i) {
    const int a = 2 * i, b = 2 * ((i + 1) % SIDES);
    mesh.faces.emplace_back(a, b, b + 1);
    mesh.faces.emplace_back(a, b + 1, a + 1);
    mesh.faces.emplace_back(2 * SIDES, b, a);
    mesh.faces.emplace_back(2 * SIDES + 1, a + 1, b + 1);
  }
  return mesh;
}

Isometry3d somewhere() {
  return Eigen::Translation3d(0.1, -0.2, 0.9) * AngleAxisd(1.1, Vector3d(1, 2, -2).normalized());
}

Isometry3d turned(double angle, const Vector3d& axis, const Vector3d& about = Vector3d::Zero()) {
  return Eigen::Translation3d(about) * AngleAxisd(angle, axis) * Eigen::Translation3d(-about);
}

TEST(PoseError, ofAShiftIsItsLength) {
  const auto model = makeReferenceModel(boxMesh(), "none");
  EXPECT_NEAR(model.diameter, 0.26, EPSILON);
  const Isometry3d truth = somewhere();
  const auto error = measurePose(model, truth, Eigen::Translation3d(0, 0.006, -0.008) * truth);
  EXPECT_NEAR(error.mssd, 0.01, EPSILON);
  EXPECT_NEAR(error.add_s, 0.01, EPSILON);
  EXPECT_NEAR(error.translation, 0.01, EPSILON);
}

TEST(PoseError, ofATurnAgreesWithTheHand) {
  const auto model = makeReferenceModel(boxMesh(), "none");
  // Upside down about x: every vertex moves by twice its distance from that axis, onto another.
  const auto over = measurePose(model, somewhere(), somewhere() * turned(M_PI, Vector3d::UnitX()));
  EXPECT_NEAR(over.mssd, 2 * std::hypot(0.04, 0.12), EPSILON);
  EXPECT_NEAR(over.add_s, 0, EPSILON);
  EXPECT_NEAR(over.translation, 0, EPSILON);
  // By 30 degrees about z: a vertex is 5 cm from the axis, its chord is 2 r sin(15 deg).
  const double chord = 2 * 0.05 * std::sin(15 * DEGREE);
  const auto aside =
      measurePose(model, somewhere(), somewhere() * turned(30 * DEGREE, Vector3d::UnitZ()));
  EXPECT_NEAR(aside.mssd, chord, EPSILON);
  EXPECT_NEAR(aside.add_s, chord, EPSILON);
}

TEST(PoseError, addSTakesTheNearestVertexForEachOfTheTruth) {
  // Shifted by 5 cm along x the box's left side has its nearest vertices 5 cm away, but its right
  // side only 1 cm: where the left side of the estimate is.
  const auto model = makeReferenceModel(boxMesh(), "none");
  const auto error =
      measurePose(model, Isometry3d::Identity(), Isometry3d(Eigen::Translation3d(0.05, 0, 0)));
  EXPECT_NEAR(error.add_s, (0.05 + 0.01) / 2, EPSILON);
  EXPECT_NEAR(error.mssd, 0.05, EPSILON);
}

TEST(PoseError, forgivesDeclaredSymmetriesAboutTheMiddleOfTheShape) {
  const Vector3d middle(0.5, 0.1, -0.2);
  const auto model = makeReferenceModel(boxMesh(middle.cast<float>()), "box 180deg");
  for (const Vector3d axis : {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()}) {
    const auto error = measurePose(model, somewhere(), somewhere() * turned(M_PI, axis, middle));
    EXPECT_NEAR(error.mssd, 0, EPSILON);
    EXPECT_NEAR(error.add_s, 0, EPSILON);
    EXPECT_NEAR(error.translation, 0, EPSILON);
  }
  const auto quarter =
      measurePose(model, somewhere(), somewhere() * turned(M_PI / 2, Vector3d::UnitZ(), middle));
  EXPECT_NEAR(quarter.mssd, 0.05 * std::sqrt(2.0), EPSILON);
}

TEST(PoseError, theHalfTurnsOfABoxFollowItsSides) {
  const AngleAxisd askew(20 * DEGREE, Vector3d(1, 2, 3).normalized());
  Mesh mesh = boxMesh();
  for (auto& vertex : mesh.vertices) vertex = askew.cast<float>() * vertex;
  const auto model = makeReferenceModel(mesh, "box 180deg");
  for (const Vector3d axis : {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()})
    EXPECT_NEAR(measurePose(model, somewhere(), somewhere() * turned(M_PI, askew * axis)).mssd, 0,
                EPSILON);
}

TEST(PoseError, translationIsMeasuredToTheBestEquivalentPose) {
  const Vector3d middle(0.5, 0, 0);
  const auto model = makeReferenceModel(boxMesh(middle.cast<float>()), "half z");
  const Isometry3d estimate =
      Eigen::Translation3d(0.003, 0, 0) * somewhere() * turned(M_PI, Vector3d::UnitZ(), middle);
  EXPECT_NEAR(measurePose(model, somewhere(), estimate).translation, 0.003, EPSILON);
}

TEST(PoseError, forgivesAnyTurnAboutAContinuousAxisToHalfADegree) {
  const auto model = makeReferenceModel(canMesh(), "axis z (continuous)");
  for (const double angle : {7.5, 33.3, 180.0, 301.2}) {
    const auto error =
        measurePose(model, somewhere(), somewhere() * turned(angle * DEGREE, Vector3d::UnitZ()));
    EXPECT_LE(error.mssd, 0.04 * 0.5 * DEGREE + EPSILON);
  }
  const auto over = measurePose(model, somewhere(), somewhere() * turned(M_PI, Vector3d::UnitX()));
  EXPECT_NEAR(over.mssd, 2 * std::hypot(0.05, 0.04), 2e-4);
}

TEST(PoseError, forgivesSymmetriesFoundInTheShapeWhereNoneIsDeclared) {
  const Isometry3d half_turn = turned(M_PI, Vector3d::UnitZ());
  const auto box = makeReferenceModel(boxMesh(), "");
  EXPECT_LT(measurePose(box, somewhere(), somewhere() * half_turn).mssd, 0.005);

  Mesh corner;
  corner.vertices = {{0, 0, 0}, {0.2f, 0, 0}, {0, 0.1f, 0}, {0, 0, 0.05f}};
  corner.faces = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const auto lopsided = makeReferenceModel(corner, "near 180deg about z");
  EXPECT_EQ(lopsided.symmetries.size(), 1u);
  EXPECT_NEAR(measurePose(lopsided, somewhere(), somewhere() * half_turn).mssd, 0.4, EPSILON);
}

TEST(PoseError, doesNotDependOnTheCamera) {
  const auto model = makeReferenceModel(canMesh(), "axis z (continuous)");
  const Isometry3d truth = somewhere();
  const Isometry3d estimate =
      truth * turned(0.3, Vector3d::UnitY()) * Eigen::Translation3d(0, 0.01, 0);
  const Isometry3d moved = Eigen::Translation3d(-1, 2, 0.5) * AngleAxisd(2, Vector3d::UnitY());
  const auto here = measurePose(model, truth, estimate);
  const auto there = measurePose(model, moved * truth, moved * estimate);
  EXPECT_NEAR(here.mssd, there.mssd, EPSILON);
  EXPECT_NEAR(here.add_s, there.add_s, EPSILON);
  EXPECT_NEAR(here.translation, there.translation, EPSILON);
}

class PoseScores : public testing::Test {
 protected:
  PoseScores() {
    models.emplace("box", makeReferenceModel(boxMesh(), "none"));
    models.emplace("can", makeReferenceModel(canMesh(), "axis z"));
  }
  static PosedObject at(const std::string& name, double x) {
    return {name, Isometry3d(Eigen::Translation3d(x, 0, 0.8))};
  }
  std::map<std::string, ReferenceModel> models;
};

TEST_F(PoseScores, pairsResultsOfOneNameNearestFirst) {
  // The second result is nearest to the first box: the other box is left with the first result.
  const auto score =
      scorePoses({at("box", 0), at("box", 0.3)}, {at("box", 0.1), at("box", 0.02)}, models);
  ASSERT_TRUE(score.truth[0].error && score.truth[1].error);
  EXPECT_NEAR(score.truth[0].error->mssd, 0.02, EPSILON);
  EXPECT_NEAR(score.truth[1].error->mssd, 0.2, EPSILON);
  EXPECT_TRUE(score.truth[0].right());
  EXPECT_FALSE(score.truth[1].right());
}

TEST_F(PoseScores, countsADuplicateAndAWrongNameAgainstThePrecisionOnly) {
  const auto score = scorePoses({at("box", 0), at("can", 0.5)},
                                {at("box", 0.001), at("box", 0.002), at("pot", 0.5)}, models);
  EXPECT_NEAR(score.truth[0].error->mssd, 0.001, EPSILON);
  EXPECT_FALSE(score.truth[1].error);
  EXPECT_EQ(score.results, (std::map<std::string, std::size_t>{{"box", 2}, {"pot", 1}}));

  const auto all = summarize({score});
  EXPECT_EQ(all.objects, 2u);
  EXPECT_EQ(all.results, 3u);
  EXPECT_EQ(all.named, 1u);
  EXPECT_EQ(all.rightShare(), 0.5);
  EXPECT_EQ(all.precision(), 1.0 / 3);

  EXPECT_EQ(namesIn({score}), (std::set<std::string>{"box", "can", "pot"}));
  const auto box = summarize(ofName({score}, "box"));
  EXPECT_EQ(box.rightShare(), 1.0);
  EXPECT_EQ(box.precision(), 0.5);
  const auto can = summarize(ofName({score}, "can"));
  EXPECT_EQ(can.rightShare(), 0.0);
  EXPECT_EQ(can.precision(), std::nullopt);
  const auto pot = summarize(ofName({score}, "pot"));
  EXPECT_EQ(pot.rightShare(), std::nullopt);
  EXPECT_EQ(pot.add_s_auc, std::nullopt);
  EXPECT_EQ(pot.precision(), 0.0);
}

TEST_F(PoseScores, refusesATruthWithoutAModel) {
  EXPECT_THROW(scorePoses({at("pot", 0)}, {}, models), std::invalid_argument);
}

TEST(PoseSummary, agreesWithTheHand) {
  // Of a diameter of 1 m, so the limits are at exactly 0.1 m and not below.
  const auto outcome = [](double mssd, double add_s, double translation) {
    return PoseOutcome{"a", 1, PoseError{mssd, add_s, translation, std::nullopt}};
  };
  PoseScore first, second;
  first.truth = {outcome(0.02, 0.01, 0.004), outcome(0.05, 0.04, 0.010), {"a", 1, std::nullopt}};
  first.results = {{"a", 2}};
  second.truth = {outcome(0.5, 0.05, 0.3), outcome(0.1, 0.1, 0.002), outcome(0.09, 0.02, 0.006)};
  second.results = {{"a", 3}, {"b", 1}};
  const auto summary = summarize({first, second});
  EXPECT_EQ(summary.objects, 6u);
  EXPECT_EQ(summary.results, 6u);
  EXPECT_EQ(summary.named, 5u);
  EXPECT_EQ(summary.right, 3u);
  EXPECT_EQ(summary.close, 4u);
  EXPECT_EQ(summary.rightShare(), 0.5);
  EXPECT_EQ(summary.closeShare(), 4.0 / 6);
  EXPECT_EQ(summary.namedShare(), 5.0 / 6);
  EXPECT_EQ(summary.precision(), 0.5);
  EXPECT_NEAR(*summary.add_s_auc, (0.9 + 0.6 + 0 + 0.5 + 0 + 0.8) / 6, 1e-12);
  EXPECT_DOUBLE_EQ(*summary.median_translation, 0.006);
  EXPECT_DOUBLE_EQ(*summarize({first}).median_translation, 0.007);
}

TEST(PoseSummary, ofNothingHasNoShares) {
  const auto summary = summarize(std::vector<PoseScore>{});
  EXPECT_EQ(summary.rightShare(), std::nullopt);
  EXPECT_EQ(summary.precision(), std::nullopt);
  EXPECT_EQ(summary.add_s_auc, std::nullopt);
  EXPECT_EQ(summary.median_translation, std::nullopt);
}

}  // namespace
}  // namespace tabletop_perception
