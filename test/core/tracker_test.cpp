#include "tabletop_perception/tracker.h"

#include <gtest/gtest.h>

namespace tabletop_perception {
namespace {

using Ids = std::vector<std::uint32_t>;

Sighting at(const std::string& name, double x) { return {name, {x, 0, 0.8}}; }

TEST(Tracker, aThingThatMovesALittleKeepsItsId) {
  Tracker tracker;
  for (int frame = 0; frame < 20; ++frame)
    EXPECT_EQ(tracker.update(0.1 * frame, {at("milk", 0.05 * frame)}), Ids{1}) << frame;
}

TEST(Tracker, aThingThatJumpsIsAnother) {
  Tracker tracker;
  tracker.update(0, {at("milk", 0)});
  EXPECT_EQ(tracker.update(0.1, {at("milk", 0.11)}), Ids{2});
}

TEST(Tracker, equalNamesAreToldApartByPlaceWhateverTheirOrder) {
  Tracker tracker;
  ASSERT_EQ(tracker.update(0, {at("can", 0), at("can", 0.08)}), (Ids{1, 2}));
  EXPECT_EQ(tracker.update(0.1, {at("can", 0.07), at("can", 0.01)}), (Ids{2, 1}));
}

TEST(Tracker, theNearestPairGoesFirst) {
  Tracker tracker;
  tracker.update(0, {at("can", 0)});
  EXPECT_EQ(tracker.update(0.1, {at("can", 0.09), at("can", 0.02)}), (Ids{2, 1}));
}

TEST(Tracker, anIdBelongsToOneName) {
  Tracker tracker;
  tracker.update(0, {at("milk", 0)});
  EXPECT_EQ(tracker.update(0.1, {at("unknown", 0)}), Ids{2});
  EXPECT_EQ(tracker.update(0.2, {at("milk", 0)}), Ids{1});
}

TEST(Tracker, aThingOutOfSightIsRememberedForTheMemoryTime) {
  Tracker tracker({0.1, 5});
  tracker.update(0, {at("milk", 0)});
  EXPECT_EQ(tracker.update(4.9, {at("milk", 0)}), Ids{1});
  EXPECT_EQ(tracker.update(10.0, {at("milk", 0)}), Ids{2});
}

TEST(Tracker, idsStayWhenTheClockJumpsBack) {
  Tracker tracker({0.1, 5});
  tracker.update(100, {at("milk", 0), at("can", 1)});
  EXPECT_EQ(tracker.update(3, {at("milk", 0)}), Ids{1});
  EXPECT_EQ(tracker.update(9, {at("milk", 0), at("can", 1)}), (Ids{3, 4})) << "memory goes on";
}

TEST(Tracker, aFrameWithoutThingsHasNoIds) { EXPECT_TRUE(Tracker().update(0, {}).empty()); }

}  // namespace
}  // namespace tabletop_perception
