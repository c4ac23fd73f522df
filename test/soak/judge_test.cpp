#include "judge.h"

#include <gtest/gtest.h>

#include "scene.h"
#include "sequence.h"

namespace tabletop_perception::soak {
namespace {

constexpr double PERIOD = 0.1;  // of the camera [s]

tools::TrueObject house(double x, bool moving = false, double visible = 1) {
  tools::TrueObject object;
  object.name = "house";
  object.T_camera_object = Eigen::Translation3d(x, 0, 0.8);
  object.visible = visible;
  object.moving = moving;
  return object;
}

PlacedThing seenAt(double x, std::uint32_t id = 1, const std::string& name = "house") {
  return {name, id, Eigen::Isometry3d(Eigen::Translation3d(x, 0, 0.8))};
}

/// A run in which every cloud shows a picture of its own.
class SoakJudge : public testing::Test {
 protected:
  SoakJudge() { models_.emplace("house", makeReferenceModel(scene::house(), "none")); }

  /// A cloud that was answered with things and as many tf frames.
  void answered(const std::vector<tools::TrueObject>& truth,
                const std::vector<PlacedThing>& things) {
    answered(truth, things, things);
  }
  void answered(const std::vector<tools::TrueObject>& truth, const std::vector<PlacedThing>& things,
                const std::vector<PlacedThing>& frames) {
    const double stamp = 100 + PERIOD * static_cast<double>(clouds_.size());
    clouds_.push_back({stamp, truth_.size(), stamp + 0.05, things, frames});
    truth_.push_back(truth);
  }
  void dropped(const std::vector<tools::TrueObject>& truth) {
    answered(truth, {});
    clouds_.back().answered.reset();
  }

  Verdict verdict() const { return judge(clouds_, truth_, models_, {}); }

  std::vector<OfferedCloud> clouds_;
  Truth truth_;
  Models models_;
};

TEST_F(SoakJudge, findsNothingWrongInARunThatIsRight) {
  for (int i = 0; i < 5; ++i) answered({house(0)}, {seenAt(0)});
  const auto v = verdict();
  EXPECT_EQ(v.id_switches + v.wrong + v.stale + v.flickers, 0u);
  EXPECT_TRUE(v.faults.empty());
  EXPECT_EQ(v.frames, 5u);
  EXPECT_EQ(v.shown, 5u);
  EXPECT_EQ(v.due, 5u);
}

TEST_F(SoakJudge, countsCloudsAndMeasuresLatency) {
  answered({house(0)}, {seenAt(0)});
  dropped({house(0)});
  dropped({house(0)});
  answered({house(0)}, {seenAt(0)});
  clouds_.back().answered = clouds_.back().stamp + 0.4;
  const auto v = verdict();
  EXPECT_EQ(v.offered, 4u);
  EXPECT_EQ(v.answered, 2u);
  EXPECT_NEAR(v.latency_p99, 0.4, 1e-9);
  EXPECT_EQ(v.flickers, 0u) << "a cloud that was dropped takes no frame away";
}

TEST_F(SoakJudge, countsAnotherIdOfTheSameThing) {
  answered({house(0)}, {seenAt(0, 1)});
  answered({house(0)}, {});
  answered({house(0)}, {seenAt(0, 2)});
  EXPECT_EQ(verdict().id_switches, 1u);
}

TEST_F(SoakJudge, countsAnotherIdOfAThingThatWasMoved) {
  answered({house(0)}, {seenAt(0, 1)});
  answered({house(0.3, true)}, {});
  answered({house(0.5)}, {seenAt(0.5, 2)});
  EXPECT_EQ(verdict().id_switches, 1u);
}

TEST_F(SoakJudge, aThingThatComesAgainMayHaveAnotherId) {
  answered({house(0)}, {seenAt(0, 1)});
  answered({}, {});
  answered({house(0)}, {seenAt(0, 2)});
  EXPECT_EQ(verdict().id_switches, 0u);
}

TEST_F(SoakJudge, countsFramesFarOffAThingAtRest) {
  answered({house(0)}, {seenAt(0.002)});
  answered({house(0)}, {seenAt(0.05)});
  const auto v = verdict();
  EXPECT_EQ(v.wrong, 1u);
  EXPECT_EQ(v.shown, 1u);
}

TEST_F(SoakJudge, countsASecondFrameOfOneThing) {
  answered({house(0)}, {seenAt(0), seenAt(0.3, 2)});
  EXPECT_EQ(verdict().wrong, 1u);
}

TEST_F(SoakJudge, doesNotMeasureThingsInMotion) {
  answered({house(0, true)}, {seenAt(0.05)});
  EXPECT_EQ(verdict().wrong, 0u);
}

TEST_F(SoakJudge, countsFramesOfWhatWasNeverThere) {
  answered({house(0)}, {seenAt(0), seenAt(0.3, 2, "mug")});
  EXPECT_EQ(verdict().wrong, 1u);
}

TEST_F(SoakJudge, aFrameIsStaleAfterTheTimeOfGrace) {
  answered({house(0)}, {seenAt(0)});
  for (int i = 0; i < 8; ++i) answered({}, {}, {seenAt(0)});
  EXPECT_EQ(verdict().stale, 3u) << "at 0.6, 0.7 and 0.8 s";
}

TEST_F(SoakJudge, countsTurnsFromOneSymmetricPoseToAnother) {
  models_.clear();
  models_.emplace("house", makeReferenceModel(scene::moved(scene::box(0.1, 0.1, 0.1), 0, 0, -0.05),
                                              "box 180deg"));
  auto turned = seenAt(0);
  turned.T_camera_object.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()));
  answered({house(0)}, {seenAt(0)});
  answered({house(0)}, {turned});
  answered({house(0)}, {turned});
  EXPECT_EQ(verdict().flips, 1u);
  EXPECT_EQ(verdict().wrong, 0u);
}

TEST_F(SoakJudge, countsFramesThatAreLostInPlainView) {
  answered({house(0)}, {seenAt(0)});
  answered({house(0)}, {});
  answered({house(0, false, 0.2)}, {});
  EXPECT_EQ(verdict().flickers, 1u);
}

TEST_F(SoakJudge, aHiddenThingNeedsNoFrame) {
  answered({house(0)}, {seenAt(0)});
  answered({house(0, false, 0.2)}, {});
  const auto v = verdict();
  EXPECT_EQ(v.flickers, 0u);
  EXPECT_EQ(v.due, 1u);
}

TEST_F(SoakJudge, unknownThingsAreNotMeasured) {
  answered({house(0)}, {seenAt(0), seenAt(0.4, 2, "unknown")});
  EXPECT_EQ(verdict().wrong, 0u);
}

TEST_F(SoakJudge, measuresHowThingsAtRestTremble) {
  for (int i = 0; i < 10; ++i) answered({house(0)}, {seenAt(i % 2 * 0.002)});
  answered({house(0, true)}, {});
  for (int i = 0; i < 10; ++i) answered({house(0.2)}, {seenAt(0.2 + i % 2 * 0.002)});
  const auto v = verdict();
  EXPECT_NEAR(v.shift.mean, 0.001, 1e-9) << "each rest by itself";
  EXPECT_NEAR(v.turn.p95, 0, 1e-9);
}

TEST(SoakSequence, isShownToAndFro) {
  std::vector<std::size_t> shown;
  for (std::size_t step = 0; step < 9; ++step) shown.push_back(toAndFro(step, 4));
  EXPECT_EQ(shown, (std::vector<std::size_t>{0, 1, 2, 3, 2, 1, 0, 1, 2}));
}

}  // namespace
}  // namespace tabletop_perception::soak
