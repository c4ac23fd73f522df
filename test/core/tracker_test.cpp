#include "tabletop_perception/tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace tabletop_perception {
namespace {

using Ids = std::vector<std::uint32_t>;

Sighting at(const std::string& name, double x) {
  Sighting sighting;
  sighting.name = name;
  sighting.T_world_object = Eigen::Translation3d(x, 0, 0.8);
  return sighting;
}

Ids idsOf(const std::vector<TrackedThing>& things) {
  Ids ids;
  for (const auto& thing : things) ids.push_back(thing.id);
  return ids;
}

/// Short of time: what is seen counts at once, what is not seen counts no more.
TrackerOptions atOnce() {
  TrackerOptions options;
  options.confirm = options.grace = 0;
  return options;
}

PoseCovariance covarianceOf(double shift, double turn) {
  PoseCovariance covariance = PoseCovariance::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(shift * shift),
      Eigen::Vector3d::Constant(turn * turn);
  return covariance;
}

/// Sightings of one thing with errors of a given size.
class Noisy {
 public:
  Noisy(double shift, double turn) : shift_(shift), turn_(turn) {}

  Sighting of(const Eigen::Isometry3d& pose) {
    const auto draw = [&](double sigma) -> Eigen::Vector3d {
      return sigma * Eigen::Vector3d(normal_(random_), normal_(random_), normal_(random_));
    };
    Sighting sighting;
    sighting.name = "milk";
    const Eigen::Vector3d turn = draw(turn_);
    sighting.T_world_object = pose;
    sighting.T_world_object.translation() += draw(shift_);
    sighting.T_world_object.linear() =
        Eigen::AngleAxisd(turn.norm(), turn.normalized()) * pose.linear();
    sighting.covariance = covarianceOf(shift_, turn_);
    return sighting;
  }

 private:
  double shift_, turn_;
  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
};

double shiftBetween(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.translation() - b.translation()).norm();
}

double turnBetween(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return Eigen::AngleAxisd(Eigen::Matrix3d(a.linear().transpose() * b.linear())).angle();
}

const Eigen::Isometry3d POSE = Eigen::Translation3d(0.1, -0.2, 0.9) *
                               Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized());

TEST(Tracker, aThingThatMovesALittleKeepsItsId) {
  Tracker tracker;
  for (int frame = 0; frame < 20; ++frame)
    EXPECT_EQ(idsOf(tracker.update(0.1 * frame, {at("milk", 0.05 * frame)})), Ids{1}) << frame;
}

TEST(Tracker, aThingThatJumpsIsAnother) {
  Tracker tracker;
  tracker.update(0, {at("milk", 0)});
  EXPECT_EQ(idsOf(tracker.update(0.1, {at("milk", 0.11)})), Ids{2});
}

TEST(Tracker, equalNamesAreToldApartByPlaceWhateverTheirOrder) {
  Tracker tracker;
  ASSERT_EQ(idsOf(tracker.update(0, {at("can", 0), at("can", 0.08)})), (Ids{1, 2}));
  EXPECT_EQ(idsOf(tracker.update(0.1, {at("can", 0.07), at("can", 0.01)})), (Ids{2, 1}));
}

TEST(Tracker, theNearestPairGoesFirst) {
  Tracker tracker;
  tracker.update(0, {at("can", 0)});
  EXPECT_EQ(idsOf(tracker.update(0.1, {at("can", 0.09), at("can", 0.02)})), (Ids{2, 1}));
}

TEST(Tracker, anIdBelongsToOneName) {
  Tracker tracker;
  tracker.update(0, {at("milk", 0)});
  EXPECT_EQ(idsOf(tracker.update(0.1, {at("unknown", 0)})), Ids{2});
  EXPECT_EQ(idsOf(tracker.update(0.2, {at("milk", 0)})), Ids{1});
}

TEST(Tracker, aThingOutOfSightIsRememberedForTheMemoryTime) {
  Tracker tracker;
  tracker.update(0, {at("milk", 0)});
  EXPECT_EQ(idsOf(tracker.update(4.9, {at("milk", 0)})), Ids{1});
  EXPECT_EQ(idsOf(tracker.update(10.0, {at("milk", 0)})), Ids{2});
}

TEST(Tracker, idsStayWhenTheClockJumpsBack) {
  Tracker tracker;
  tracker.update(100, {at("milk", 0), at("can", 1)});
  EXPECT_EQ(idsOf(tracker.update(3, {at("milk", 0)})), Ids{1});
  EXPECT_EQ(idsOf(tracker.update(9, {at("milk", 0), at("can", 1)})), (Ids{3, 4}))
      << "memory goes on";
}

/// Seen about its frame's origin.
Sighting seenAt(const std::string& name, double x) {
  Sighting sighting = at(name, x);
  sighting.middle = sighting.T_world_object.translation();
  return sighting;
}

TEST(Tracker, aThingThatLosesItsNameOnTheWayKeepsItsId) {
  Tracker tracker;
  ASSERT_EQ(idsOf(tracker.update(0, {seenAt("milk", 0)})), Ids{1});
  for (int frame = 1; frame < 10; ++frame)
    EXPECT_EQ(idsOf(tracker.update(0.1 * frame, {seenAt("unknown", 0.05 * frame)})), Ids{2});
  EXPECT_EQ(idsOf(tracker.update(1, {seenAt("milk", 0.5)})), Ids{1});
}

TEST(Tracker, aThingThatWasOutOfSightMayHaveMovedFarther) {
  for (const double x : {0.35, 0.45}) {
    Tracker tracker;
    tracker.update(0, {at("milk", 0)});
    tracker.update(1, {});
    EXPECT_EQ(idsOf(tracker.update(1.1, {at("milk", x)})), Ids{x < 0.4 ? 1u : 2u}) << x;
  }
}

TEST(Tracker, anUnknownThingFarAwayDoesNotCarryAName) {
  Tracker tracker;
  tracker.update(0, {seenAt("milk", 0)});
  for (int frame = 1; frame < 10; ++frame)
    tracker.update(0.1 * frame, {seenAt("unknown", 0.3 + 0.02 * frame)});
  EXPECT_EQ(idsOf(tracker.update(1, {seenAt("milk", 0.5)})), Ids{3});
}

TEST(Tracker, aHandThatPassesDoesNotTakeAThingsIdAway) {
  Tracker tracker;
  tracker.update(0, {seenAt("milk", 0)});
  for (int frame = 1; frame < 10; ++frame)  // over the thing and on
    tracker.update(0.1 * frame, {seenAt("unknown", 0.08 * frame - 0.1)});
  EXPECT_EQ(idsOf(tracker.update(1, {seenAt("milk", 0)})), Ids{1});
}

TEST(Tracker, whatIsNamedCarriesNoOtherName) {
  Tracker tracker;
  tracker.update(0, {seenAt("milk", 0)});
  for (int frame = 1; frame < 10; ++frame)
    tracker.update(0.1 * frame, {seenAt("can", 0.05 * frame)});
  EXPECT_EQ(idsOf(tracker.update(1, {seenAt("milk", 0.5)})), Ids{3});
}

TEST(Tracker, aFrameWithoutThingsHasNoIds) { EXPECT_TRUE(Tracker().update(0, {}).empty()); }

TEST(Tracker, aThingIsConfirmedOnceItWasSeenLongEnough) {
  TrackerOptions options;
  options.confirm = 0.25;
  Tracker tracker(options);
  for (int frame = 0; frame < 6; ++frame) {
    const auto things = tracker.update(0.1 * frame, {at("milk", 0)});
    EXPECT_EQ(things[0].confirmed, frame >= 3) << frame;
  }
}

TEST(Tracker, aConfirmedThingStaysForItsTimeOfGrace) {
  TrackerOptions options = atOnce();
  options.grace = 0.25;
  Tracker tracker(options);
  tracker.update(0, {at("milk", 0), at("can", 0.5)});
  tracker.update(0.1, {at("can", 0.5)});
  ASSERT_EQ(idsOf(tracker.missed()), Ids{1});
  EXPECT_EQ(tracker.missed()[0].name, "milk");
  tracker.update(0.3, {at("can", 0.5)});
  EXPECT_TRUE(tracker.missed().empty());
  EXPECT_EQ(idsOf(tracker.update(0.4, {at("milk", 0)})), Ids{1}) << "its id is remembered longer";
}

TEST(Tracker, whatWasNotConfirmedIsNotMissed) {
  Tracker tracker;
  tracker.update(0, {at("milk", 0)});
  tracker.update(0.1, {});
  EXPECT_TRUE(tracker.missed().empty());
}

TEST(Tracker, aThingAtRestTremblesLessThanItsSightings) {
  Tracker tracker;
  Noisy noisy(0.002, 0.02);
  double seen_shift = 0, seen_turn = 0, shift = 0, turn = 0;  // sums of squares
  for (int frame = 0; frame < 300; ++frame) {
    const Sighting sighting = noisy.of(POSE);
    const auto things = tracker.update(frame / 30.0, {sighting});
    ASSERT_EQ(things[0].id, 1u);
    if (frame < 60) continue;
    seen_shift += std::pow(shiftBetween(sighting.T_world_object, POSE), 2);
    seen_turn += std::pow(turnBetween(sighting.T_world_object, POSE), 2);
    shift += std::pow(shiftBetween(things[0].T_world_object, POSE), 2);
    turn += std::pow(turnBetween(things[0].T_world_object, POSE), 2);
  }
  EXPECT_LT(shift, 0.1 * seen_shift);
  EXPECT_LT(turn, 0.1 * seen_turn);
}

TEST(Tracker, aThingThatIsMovedIsFollowedAtOnce) {
  Tracker tracker;
  Noisy noisy(0.001, 0.01);
  for (int frame = 0; frame < 60; ++frame) tracker.update(frame / 30.0, {noisy.of(POSE)});
  Eigen::Isometry3d moved = POSE;
  moved.translation().x() += 0.03;
  const auto things = tracker.update(2, {noisy.of(moved)});
  EXPECT_EQ(things[0].id, 1u);
  EXPECT_LT(shiftBetween(things[0].T_world_object, moved), 0.004);
}

TEST(Tracker, whatASightingDoesNotTellIsKept) {
  Tracker tracker;
  Noisy noisy(0.001, 0.01);
  for (int frame = 0; frame < 30; ++frame) tracker.update(frame / 30.0, {noisy.of(POSE)});
  // From now on nothing tells how it is turned about z.
  for (int frame = 30; frame < 60; ++frame) {
    Sighting sighting = noisy.of(POSE);
    sighting.T_world_object.linear() =
        Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) * sighting.T_world_object.linear();
    sighting.covariance(5, 5) = 1;
    const auto things = tracker.update(frame / 30.0, {sighting});
    EXPECT_LT(turnBetween(things[0].T_world_object, POSE), 0.03);
  }
}

TEST(Tracker, ofPosesThatLookTheSameTheNearestIsTaken) {
  Symmetry box;
  box.center = {0.01, 0.02, 0.03};
  for (int axis = 0; axis < 3; ++axis)
    box.rotations.push_back(
        Eigen::AngleAxisd(M_PI, Eigen::Vector3d::Unit(axis)).toRotationMatrix());
  Symmetry can;
  can.center = {0, 0, 0.05};
  can.axis = Eigen::Vector3d::UnitZ();
  can.rotations.push_back(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()).toRotationMatrix());

  std::mt19937 random(3);
  for (const auto& symmetry : {box, can}) {
    Tracker tracker;
    Noisy noisy(0.001, 0.01);
    for (int frame = 0; frame < 60; ++frame) {
      Eigen::Isometry3d motion(Eigen::Translation3d(symmetry.center));
      if (symmetry.continuous())
        motion.rotate(Eigen::AngleAxisd(0.1 * static_cast<double>(random() % 60), symmetry.axis));
      if (random() % 2 == 0)
        motion.rotate(symmetry.rotations[random() % symmetry.rotations.size()]);
      motion.translate(-symmetry.center);
      Sighting sighting = noisy.of(POSE * motion);
      sighting.symmetry = symmetry;
      const auto things = tracker.update(frame / 30.0, {sighting});
      static Eigen::Isometry3d first;
      if (frame == 0) first = things[0].T_world_object;
      EXPECT_LT(turnBetween(things[0].T_world_object, first), 0.05) << frame;
      EXPECT_LT(shiftBetween(things[0].T_world_object, first), 0.008) << frame;
    }
  }
}

TEST(Tracker, aThingThatMayTurnFreelyDoesNotSpin) {
  Symmetry can;
  can.axis = Eigen::Vector3d::UnitZ();
  can.center = {0.002, 0.001, 0.01};  // its axis passes by the frame's origin
  Tracker tracker;
  Noisy noisy(0.0007, 0.008);
  Noisy axes(0.001, 0.01);  // about which nothing is known: none is quite the true one
  Eigen::Isometry3d first;
  for (int frame = 0; frame < 300; ++frame) {
    Sighting sighting = noisy.of(POSE);
    sighting.symmetry = can;
    const Eigen::Isometry3d unsure = axes.of(POSE).T_world_object;
    const Eigen::Vector3d axis = unsure.linear().col(2);
    Eigen::Matrix<double, 6, 1> turn;
    turn << axis.cross(sighting.T_world_object.translation() - unsure * can.center), axis;
    sighting.covariance = covarianceOf(0.0003, 0.004) + 2.5 * turn * turn.transpose();
    const auto things = tracker.update(frame / 30.0, {sighting});
    if (frame == 0) first = things[0].T_world_object;
    ASSERT_LT(turnBetween(things[0].T_world_object, first), 0.05) << frame;
  }
}

/// A thing at rest of which every so many sightings says that it is upside down.
class TurnedOver : public testing::Test {
 protected:
  Eigen::Isometry3d afterFrame(bool turned, double sure, bool decided = true) {
    Sighting sighting = noisy_.of(turned ? upside_down_ : POSE);
    sighting.middle = middle_;
    sighting.turn = sure;
    sighting.decided = decided;
    return tracker_.update(frame_++ / 30.0, {sighting})[0].T_world_object;
  }

  int framesUntilTurned(double sure) {
    for (int frames = 1; frames < 100; ++frames)
      if (turnBetween(afterFrame(true, sure), upside_down_) < 0.1) return frames;
    return 100;
  }

  const Eigen::Isometry3d upside_down_ =
      POSE * Eigen::Translation3d(0.01, 0, 0) * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
  Eigen::Vector3d middle_ = POSE.translation();
  Tracker tracker_;
  Noisy noisy_{0.001, 0.01};
  int frame_ = 0;
};

TEST_F(TurnedOver, aThingStaysAsItIsWhereMostSightingsSaySo) {
  for (int i = 0; i < 300; ++i) EXPECT_LT(turnBetween(afterFrame(i % 3 == 2, 0.7), POSE), 0.1) << i;
}

TEST_F(TurnedOver, aThingIsTurnedWhereMuchMoreSpeaksForIt) {
  for (int i = 0; i < 3; ++i) afterFrame(false, 0.7);
  EXPECT_EQ(framesUntilTurned(0.95), 4) << "e^8 and three times 7 to 3, in steps of 19";
}

TEST_F(TurnedOver, aThingOfWhichNothingTellsTheTurnIsNotTurnedToAndFro) {
  std::mt19937 random(7);
  int turns = 0;
  Eigen::Isometry3d last = afterFrame(false, 0.6);
  for (int i = 0; i < 1000; ++i) {
    const auto pose = afterFrame(random() % 2 == 0, 0.6);
    turns += turnBetween(last, pose) > 1;
    last = pose;
  }
  EXPECT_LE(turns, 1);
}

TEST_F(TurnedOver, aThingThatIsHalfHiddenStaysAsItIs) {
  for (int i = 0; i < 100; ++i) afterFrame(false, 0.9);
  middle_.x() += 0.05;  // of what is still seen of it
  EXPECT_LT(turnBetween(afterFrame(true, 0.7), POSE), 0.1);
}

TEST_F(TurnedOver, aThingThatWasTurnedIsSoonSeenSo) {
  for (int i = 0; i < 300; ++i) afterFrame(false, 0.999);
  EXPECT_LE(framesUntilTurned(0.999), 4);
}

TEST_F(TurnedOver, whatWasTakenOverFromTheLastFrameSpeaksForNothing) {
  afterFrame(false, 0.7);
  for (int i = 0; i < 100; ++i) afterFrame(false, 0.7, false);
  EXPECT_EQ(framesUntilTurned(0.8), 7);
}

TEST(Tracker, withoutACovarianceAPoseIsTakenAsItIs) {
  Tracker tracker;
  tracker.update(0, {at("unknown", 0)});
  EXPECT_EQ(tracker.update(0.1, {at("unknown", 0.01)})[0].T_world_object.translation().x(), 0.01);
}

}  // namespace
}  // namespace tabletop_perception
