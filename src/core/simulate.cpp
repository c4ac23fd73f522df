#include "tabletop_perception/simulate.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "scenery.h"

namespace tabletop_perception {
namespace {

/// A stretch of a sequence; times go from 0 at its first frame to 1 at its last.
struct Stretch {
  double from, to;

  bool holds(double time) const { return time >= from && time < to; }
  /// How much of it is over, 0 to 1, without jerks at its ends.
  double progress(double time) const {
    const double share = std::clamp((time - from) / (to - from), 0.0, 1.0);
    return share * share * (3 - 2 * share);
  }
};

constexpr Stretch ARRIVALS{0.05, 0.35};  // all but the first and second thing are put down
constexpr Stretch MOVE{0.4, 0.55};       // the first thing comes to another place
constexpr Stretch HAND{0.6, 0.8};        // a forearm passes over the table
constexpr Stretch LEAVE{0.85, 0.95};     // the last of at least three things is taken away
constexpr double LIFT = 0.3;             // of what comes or leaves [m]
constexpr double MOVE_LIFT = 0.15;       // of what is moved [m]
constexpr double HAND_HEIGHT = 0.35;     // of the forearm's top above the table [m]
constexpr double HAND_REACH = 0.6;       // to both sides, from where to where it passes [m]

/// What happens to the things on a table.
class Choreography {
 public:
  explicit Choreography(const Scenery& scenery) : scenery_(scenery) {}

  std::vector<Scenery::Thing> thingsAt(double time) const {
    std::vector<Scenery::Thing> things;
    for (std::size_t i = 0; i < scenery_.placed().size(); ++i)
      if (const auto thing = thingAt(i, time)) things.push_back(*thing);
    return things;
  }

  std::optional<Eigen::Isometry3d> handAt(double time) const {
    if (!HAND.holds(time)) return std::nullopt;
    const Eigen::Vector3d right = scenery_.rightOnTable();
    Eigen::Isometry3d T_table_hand = Eigen::Isometry3d::Identity();
    T_table_hand.linear().col(0) = right;
    T_table_hand.linear().col(1) = Eigen::Vector3d::UnitZ().cross(right);
    T_table_hand.translation() =
        HAND_REACH * (2 * HAND.progress(time) - 1) * right + HAND_HEIGHT * Eigen::Vector3d::UnitZ();
    return T_table_hand;
  }

 private:
  std::optional<Scenery::Thing> thingAt(std::size_t i, double time) const {
    const std::size_t count = scenery_.placed().size();
    Scenery::Thing thing{i, scenery_.placed()[i].T_table_object, false};
    const auto lifted = [&](double height, bool moving) {
      thing.T_table_object.pretranslate(Eigen::Vector3d(0, 0, height));
      thing.moving = moving;
      return thing;
    };
    if (i == 0 && scenery_.spare()) {
      const double progress = MOVE.progress(time);
      const auto& from = thing.T_table_object;
      const auto& to = scenery_.spare()->T_table_object;
      thing.T_table_object.translation() += progress * (to.translation() - from.translation());
      return lifted(MOVE_LIFT * std::sin(M_PI * progress), MOVE.holds(time));
    }
    if (i > 1) {
      const double each = (ARRIVALS.to - ARRIVALS.from) / static_cast<double>(count - 2);
      const double begin = ARRIVALS.from + static_cast<double>(i - 2) * each;
      const Stretch arrival{begin, begin + each};
      if (time < arrival.from) return std::nullopt;
      if (arrival.holds(time)) return lifted(LIFT * (1 - arrival.progress(time)), true);
    }
    if (i > 1 && i + 1 == count) {
      if (time >= LEAVE.to) return std::nullopt;
      if (LEAVE.holds(time)) return lifted(LIFT * LEAVE.progress(time), true);
    }
    return thing;
  }

  const Scenery& scenery_;
};

std::vector<Scenery::Thing> allAtRest(const Scenery& scenery) {
  std::vector<Scenery::Thing> things;
  for (std::size_t i = 0; i < scenery.placed().size(); ++i)
    things.push_back({i, scenery.placed()[i].T_table_object, false});
  return things;
}

}  // namespace

SimulatedScene simulateScene(const TableObjects& objects, const SimulationOptions& options,
                             Random& random) {
  const Scenery scenery(objects, options, false, random);
  return scenery.sensed(scenery.look(allAtRest(scenery)), random);
}

void simulateStill(const TableObjects& objects, const SimulationOptions& options, int frames,
                   Random& random, const FrameVisitor& visit) {
  const Scenery scenery(objects, options, false, random);
  const auto picture = scenery.look(allAtRest(scenery));
  for (int frame = 0; frame < frames; ++frame) visit(frame, scenery.sensed(picture, random));
}

void simulateSequence(const TableObjects& objects, const SimulationOptions& options, int frames,
                      Random& random, const FrameVisitor& visit) {
  const Scenery scenery(objects, options, true, random);
  const Choreography choreography(scenery);
  for (int frame = 0; frame < frames; ++frame) {
    const double time = frames > 1 ? frame / (frames - 1.0) : 0;
    const auto picture = scenery.look(choreography.thingsAt(time), choreography.handAt(time));
    visit(frame, scenery.sensed(picture, random));
  }
}

}  // namespace tabletop_perception
