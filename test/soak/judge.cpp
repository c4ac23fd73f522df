#include "judge.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "tabletop_perception/geometry.h"

namespace tabletop_perception::soak {
namespace {

constexpr double WRONG = 0.1;                   // of the diameter, in MSSD
constexpr double FLIP_ANGLE = 30 * M_PI / 180;  // from one frame to the next

/// What is known of an object up to the cloud that is looked at.
struct History {
  double last_present = -std::numeric_limits<double>::infinity();  ///< [s]
  std::optional<std::uint32_t> id;                                 ///< since it came
  bool had_frame = false;               ///< with the last answer, in plain view at rest
  std::vector<Eigen::Isometry3d> rest;  ///< right frames since it came to rest
};

double quantile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return 0;
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1) + 0.5)];
}

/// Goes through the clouds of a run.
class Judge {
 public:
  Judge(const Models& models, const JudgeOptions& options) : models_(models), options_(options) {}

  void look(const OfferedCloud& cloud, const std::vector<tools::TrueObject>& truth) {
    cloud_ = &cloud;
    if (verdict_.offered++ == 0) start_ = cloud.stamp;
    std::set<std::string> present;
    for (const auto& object : truth) {
      present.insert(object.name);
      auto& history = histories_[object.name];
      history.last_present = cloud.stamp;
      if (object.moving) endRest(object.name, history);
    }
    for (auto& [name, history] : histories_) {
      if (present.count(name)) continue;
      endRest(name, history);
      history.id.reset();
    }
    if (!cloud.answered) return;
    ++verdict_.answered;
    latencies_.push_back(*cloud.answered - cloud.stamp);
    for (const auto& object : truth) {
      judgeId(object);
      judgeShown(object);
    }
    for (const auto& frame : cloud.frames)
      if (frame.name != "unknown") judgeFrame(frame, truth);
  }

  Verdict verdict() && {
    for (auto& [name, history] : histories_) endRest(name, history);
    tools::Deviations all;
    for (const auto& [name, deviations] : verdict_.rests) append(deviations, all);
    std::sort(latencies_.begin(), latencies_.end());
    verdict_.latency_p50 = quantile(latencies_, 0.5);
    verdict_.latency_p99 = quantile(latencies_, 0.99);
    verdict_.shift = tools::spreadOf(std::move(all.shifts));
    verdict_.turn = tools::spreadOf(std::move(all.turns));
    return std::move(verdict_);
  }

 private:
  void judgeId(const tools::TrueObject& object) {
    const PlacedThing* nearest = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const auto& thing : cloud_->objects) {
      if (thing.name != object.name) continue;
      const double distance = errorOf(object, thing);
      if (distance >= least) continue;
      least = distance;
      nearest = &thing;
    }
    if (!nearest) return;
    auto& history = histories_[object.name];
    if (history.id && *history.id != nearest->id) {
      ++verdict_.id_switches;
      fault(object.name + ": id " + std::to_string(*history.id) + " became " +
            std::to_string(nearest->id));
    }
    history.id = nearest->id;
  }

  void judgeShown(const tools::TrueObject& object) {
    auto& history = histories_[object.name];
    const bool due = !object.moving && object.visible.value_or(1) >= options_.min_visible;
    bool has_frame = false, right = false;
    for (const auto& frame : cloud_->frames) {
      if (frame.name != object.name) continue;
      has_frame = true;
      right = right || isRight(object, frame);
    }
    if (due) {
      ++verdict_.due;
      verdict_.shown += right;
      if (history.had_frame && !has_frame) {
        ++verdict_.flickers;
        fault(object.name + " in plain view lost its frame");
      }
    }
    history.had_frame = due && has_frame;
  }

  void judgeFrame(const PlacedThing& frame, const std::vector<tools::TrueObject>& truth) {
    ++verdict_.frames;
    const std::string label = frame.name + "_" + std::to_string(frame.id);
    const auto object = std::find_if(truth.begin(), truth.end(),
                                     [&](const auto& one) { return one.name == frame.name; });
    if (object != truth.end()) {
      if (object->moving) return;
      if (isRight(*object, frame)) {
        auto& rest = histories_[frame.name].rest;
        if (!rest.empty() && angleOf(rest.back().linear().transpose() *
                                     frame.T_camera_object.linear()) > FLIP_ANGLE) {
          ++verdict_.flips;
          fault("flip: " + label);
        }
        rest.push_back(frame.T_camera_object);
        return;
      }
      ++verdict_.wrong;
      char text[80];
      std::snprintf(text, sizeof text, " is %.0f mm off, %.2f visible",
                    1000 * errorOf(*object, frame), object->visible.value_or(1));
      fault("wrong frame: " + label + text);
      return;
    }
    const auto history = histories_.find(frame.name);
    if (history == histories_.end()) {
      ++verdict_.wrong;
      fault("wrong frame: " + label + " was never there");
    } else if (cloud_->stamp - history->second.last_present > options_.grace) {
      ++verdict_.stale;
      char text[80];
      std::snprintf(text, sizeof text, " is gone for %.2f s",
                    cloud_->stamp - history->second.last_present);
      fault("stale frame: " + label + text);
    }
  }

  bool isRight(const tools::TrueObject& object, const PlacedThing& thing) const {
    return errorOf(object, thing) < WRONG * models_.at(object.name).diameter;
  }

  double errorOf(const tools::TrueObject& object, const PlacedThing& thing) const {
    return measurePose(models_.at(object.name), object.T_camera_object, thing.T_camera_object).mssd;
  }

  void endRest(const std::string& name, History& history) {
    append(tools::deviationsFromMean(history.rest), verdict_.rests[name]);
    history.rest.clear();
    history.had_frame = false;
  }

  static void append(const tools::Deviations& from, tools::Deviations& to) {
    to.shifts.insert(to.shifts.end(), from.shifts.begin(), from.shifts.end());
    to.turns.insert(to.turns.end(), from.turns.begin(), from.turns.end());
  }

  void fault(const std::string& what) {
    char text[60];
    std::snprintf(text, sizeof text, "%.2f s, picture %zu: ", cloud_->stamp - start_,
                  cloud_->picture);
    verdict_.faults.push_back(text + what);
  }

  const Models& models_;
  const JudgeOptions& options_;
  const OfferedCloud* cloud_ = nullptr;  ///< that is looked at
  double start_ = 0;                     ///< stamp of the first one [s]
  std::map<std::string, History> histories_;
  std::vector<double> latencies_;
  Verdict verdict_;
};

}  // namespace

Verdict judge(const std::vector<OfferedCloud>& clouds, const Truth& truth, const Models& models,
              const JudgeOptions& options) {
  Judge judge(models, options);
  for (const auto& cloud : clouds) judge.look(cloud, truth[cloud.picture]);
  return std::move(judge).verdict();
}

}  // namespace tabletop_perception::soak
