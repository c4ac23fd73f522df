#include <cmath>
#include <cstdint>
#include <set>

#include "findings.h"

/// Whether clouds come, how they are stamped and how many of them get through.
namespace tabletop_perception::tools {
namespace {

constexpr double MAX_AGE = 0.5;     ///< of a cloud when it arrives [s]
constexpr double MAX_AHEAD = 0.1;   ///< of a stamp before the clock [s]
constexpr double MAX_LOST = 0.1;    ///< share of the clouds that may be missing
constexpr double MIN_CLOUDS = 0.5;  ///< clouds per camera_info
constexpr int FEW = 5;              ///< messages that say nothing about a rate yet

/// The topics of a type, as many as a line holds.
std::string topicsOf(const Observed& seen, const std::string& type) {
  std::vector<std::string> names;
  for (const auto& [name, topic] : seen.topics)
    if (topic.type == type && names.size() < 5) names.push_back(name);
  return listOf(names);
}

/// How to get clouds, for a camera that may only send images.
std::string cloudAdvice(const Observed& seen) {
  const auto clouds = topicsOf(seen, CLOUD_TYPE);
  if (!clouds.empty())
    return "there is " + clouds + (seen.graph ? " (perception.launch input:=TOPIC)" : " (--topic)");
  const auto images = topicsOf(seen, "sensor_msgs/Image");
  if (!images.empty())
    return "there are only images, " + images +
           ": perception.launch depth:=TOPIC makes clouds of depth images";
  return "no topic of that type is there: is the camera's driver running?";
}

/// Rate of messages of which `count` came [Hz].
double rate(int count, double seconds) { return seconds > 0 ? count / seconds : 0; }

/// How many clouds were sent between the first and the last that came, by the publisher's count.
/// None: it does not count.
std::optional<std::int64_t> sentClouds(const std::vector<CloudSeen>& clouds) {
  for (std::size_t i = 1; i < clouds.size(); ++i)
    if (clouds[i].seq <= clouds[i - 1].seq) return std::nullopt;
  return std::int64_t{clouds.back().seq} - clouds.front().seq + 1;
}

/// The same from the stamps: the camera's interval is the shortest that is usual.
std::int64_t stampedClouds(const std::vector<CloudSeen>& clouds) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < clouds.size(); ++i)
    intervals.push_back(clouds[i].stamp - clouds[i - 1].stamp);
  std::sort(intervals.begin(), intervals.end());
  const double interval = intervals[intervals.size() / 5];
  std::int64_t sent = 1;
  for (const double passed : intervals)
    sent += std::max<std::int64_t>(1, std::llround(passed / interval));
  return sent;
}

}  // namespace

void checkInput(const Observed& seen, Findings& findings) {
  if (seen.input.empty()) {
    const bool filter_runs =
        seen.graph && !seen.graph->stages.empty() && seen.graph->stages.front().second;
    if (filter_runs)
      findings.error("input_unknown",
                     "the filter of " + seen.graph->ns +
                         " listens to no topic although its results are wanted: it hangs, or name "
                         "the camera's topic with --topic");
    else if (topicsOf(seen, CLOUD_TYPE).empty())
      findings.error("no_cloud_topic", "no topic of type " + std::string(CLOUD_TYPE) + " in " +
                                           seen.source + ": " + cloudAdvice(seen));
    return;
  }
  const auto topic = seen.topics.find(seen.input);
  if (topic == seen.topics.end()) {
    const std::string what = seen.graph ? "nobody publishes " + seen.input + ", the filter's input"
                                        : "no topic " + seen.input + " in " + seen.source;
    const bool others = !topicsOf(seen, CLOUD_TYPE).empty();
    findings.error(others ? "wrong_topic" : "no_cloud_topic", what + ": " + cloudAdvice(seen));
    return;
  }
  if (topic->second.type != CLOUD_TYPE) {
    findings.error("wrong_type", seen.input + " has the type " + topic->second.type + ", must be " +
                                     CLOUD_TYPE + ": " + cloudAdvice(seen));
    return;
  }
  if (topic->second.publishers.size() > 1)
    findings.warning("several_cameras", std::to_string(topic->second.publishers.size()) +
                                            " nodes publish " + seen.input + " (" +
                                            listOf(topic->second.publishers) +
                                            "), must be one: clouds of two cameras mix");
  if (seen.clouds.empty())
    findings.error("camera_silent",
                   seen.input + " is there, but sent no cloud in " + figure(seen.seconds) +
                       " s: is the camera plugged in, does its driver wait for a listener of "
                       "another topic, is a bag played to its end or paused?");
}

std::optional<double> cloudLag(const Observed& seen) {
  std::vector<double> lags;
  for (const auto& cloud : seen.clouds)
    if (cloud.arrival && cloud.stamp != 0) lags.push_back(*cloud.arrival - cloud.stamp);
  return lags.empty() ? std::nullopt : std::optional(median(lags));
}

void checkHeaders(const Observed& seen, Findings& findings) {
  const bool sim_time = seen.graph && seen.graph->use_sim_time;
  if (sim_time && !seen.clock)
    findings.error("sim_time_without_clock",
                   "use_sim_time is true, but nothing came on /clock in " + figure(seen.seconds) +
                       " s: time stands still; play the bag with --clock, or `rosparam set "
                       "use_sim_time false` and start the nodes again");
  if (seen.graph && !sim_time && seen.clock)
    findings.error(
        "clock_without_sim_time",
        "/clock is published, but use_sim_time is false" +
            (cloudLag(seen) ? ", clouds are " + figure(*cloudLag(seen)) + " s old by the wall clock"
                            : std::string()) +
            ": set use_sim_time to true before the nodes start (bag.launch does)");
  if (seen.clouds.empty()) return;

  const auto& frame = seen.clouds.back().frame_id;
  if (frame.empty())
    findings.error("frame_empty", "header.frame_id of " + seen.input +
                                      " is empty: must name the camera's tf frame, as "
                                      "camera_depth_optical_frame");
  else if (frame[0] == '/')
    findings.error("frame_slash", "header.frame_id of " + seen.input + " is '" + frame +
                                      "', must be '" + frame.substr(1) +
                                      "': tf2 refuses a slash in front");
  const auto other = std::find_if(seen.clouds.begin(), seen.clouds.end(),
                                  [&](const CloudSeen& cloud) { return cloud.frame_id != frame; });
  if (other != seen.clouds.end() && !findings.any({"several_cameras"}))
    findings.warning("frame_changes",
                     "clouds on " + seen.input + " come in the frames '" + other->frame_id +
                         "' and '" + frame +
                         "', must be one: whenever it changes, the objects get new ids unless "
                         "track_frame is set");

  const auto zeros = std::count_if(seen.clouds.begin(), seen.clouds.end(),
                                   [](const CloudSeen& cloud) { return cloud.stamp == 0; });
  if (zeros > 0) {
    findings.error("stamp_zero", std::to_string(zeros) + " of " +
                                     std::to_string(seen.clouds.size()) + " clouds on " +
                                     seen.input + " have stamp 0: must be the time of the picture");
    return;
  }
  for (std::size_t i = 1; i < seen.clouds.size(); ++i)
    if (seen.clouds[i].stamp <= seen.clouds[i - 1].stamp) {
      findings.error("stamp_not_increasing",
                     "stamps on " + seen.input + " do not increase: after " +
                         std::to_string(seen.clouds[i - 1].stamp) + " came " +
                         std::to_string(seen.clouds[i].stamp) +
                         "; frames are told apart by their stamps (did a bag begin anew, do two "
                         "nodes publish?)");
      break;
    }

  if (findings.any({"sim_time_without_clock", "clock_without_sim_time"})) return;
  const auto lag = cloudLag(seen);
  if (!lag) return;
  if (*lag < -MAX_AHEAD)
    findings.error("stamp_future", "stamps on " + seen.input + " are " + figure(-*lag) +
                                       " s ahead of the clock, limit " + figure(MAX_AHEAD) +
                                       ": synchronise the clocks of the machines (chrony)");
  else if (*lag > MAX_AGE)
    findings.warning("stamp_old", "clouds on " + seen.input + " are " + figure(*lag) +
                                      " s old when they come, limit " + figure(MAX_AGE) +
                                      ": clocks that differ, a driver that buffers, a slow "
                                      "network, or a bag without --clock");
}

void checkRates(const Observed& seen, Findings& findings) {
  const int came = static_cast<int>(seen.clouds.size());
  if (came < FEW || findings.any({"stamp_zero", "stamp_not_increasing", "several_cameras"})) return;

  const std::int64_t sent = sentClouds(seen.clouds).value_or(stampedClouds(seen.clouds));
  const double lost = 1 - static_cast<double>(came) / std::max<std::int64_t>(came, sent);
  if (lost > MAX_LOST) {
    std::size_t bytes = 0;
    for (const auto& cloud : seen.clouds) bytes += cloud.bytes;
    const double megabytes = rate(1, seen.seconds) * static_cast<double>(bytes) / 1e6;
    findings.warning("network_slow",
                     std::to_string(sent - came) + " of " + std::to_string(sent) + " clouds on " +
                         seen.input + " never came: " + figure(megabytes) + " MB/s arrive, " +
                         figure(megabytes * sent / came) +
                         " MB/s are needed; unless something thins them on purpose, run the filter "
                         "on the camera's machine, or lower "
                         "resolution or rate");
    return;
  }
  if (seen.camera_infos >= FEW && came < MIN_CLOUDS * seen.camera_infos)
    findings.warning("rate_low", "clouds come at " + figure(rate(came, seen.seconds)) + " Hz on " +
                                     seen.input + ", the camera takes " +
                                     figure(rate(seen.camera_infos, seen.seconds)) + " Hz (" +
                                     seen.camera_info +
                                     "): what makes the clouds is too slow, or depth and colour "
                                     "are not in step");
}

}  // namespace tabletop_perception::tools
