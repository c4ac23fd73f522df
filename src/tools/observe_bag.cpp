#include <rosbag/view.h>
#include <rosgraph_msgs/Clock.h>

#include <filesystem>
#include <stdexcept>

#include "bag_file.h"
#include "conversions.h"
#include "findings.h"
#include "observe.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception::tools {
namespace {

constexpr int LOOKED_AT = 3;  ///< clouds whose points are read

/// The only topic with clouds; empty: there is none.
std::string onlyCloudTopic(const Observed& seen) {
  std::vector<std::string> clouds;
  for (const auto& [name, topic] : seen.topics)
    if (topic.type == CLOUD_TYPE) clouds.push_back(name);
  if (clouds.size() > 1)
    throw std::invalid_argument(
        seen.source +
        ": several topics with clouds, choose the camera's with --topic: " + listOf(clouds));
  return clouds.empty() ? "" : clouds.front();
}

/// Whether the default options find a table.
void lookForTable(const sensor_msgs::PointCloud2& message, TablesSeen& tables) {
  const auto segmentation = segmentScene(cloudFromMessage(message), std::nullopt, {});
  ++tables.frames;
  if (segmentation.table) ++tables.found;
  tables.reason = segmentation.reason;
}

class BagObserver {
 public:
  BagObserver(Observed& seen, std::size_t clouds) : seen_(seen), clouds_(clouds) {}

  void add(const rosbag::MessageInstance& instance) {
    const auto& topic = instance.getTopic();
    const double arrival = instance.getTime().toSec();
    if (topic == seen_.input && instance.isType<sensor_msgs::PointCloud2>())
      addCloud(*instance.instantiate<sensor_msgs::PointCloud2>(), arrival);
    else if (topic == seen_.camera_info)
      ++seen_.camera_infos;
    else if (topic == "/tf" || topic == "/tf_static")
      if (const auto message = instance.instantiate<tf2_msgs::TFMessage>())
        transforms_.add(*message, topic == "/tf_static", arrival);
  }

  void finish() { seen_.transforms = transforms_.seen(seen_.seconds); }

 private:
  void addCloud(const sensor_msgs::PointCloud2& message, double arrival) {
    auto cloud = cloudSeen(message);
    cloud.arrival = arrival;
    // in the middle of as many equal parts of the bag
    const std::size_t number = seen_.clouds.size();
    const bool look =
        number % std::max<std::size_t>(1, clouds_ / LOOKED_AT) == clouds_ / LOOKED_AT / 2;
    seen_.clouds.push_back(std::move(cloud));
    if (!look) return;
    seen_.points.push_back(pointsSeen(message));
    if (seen_.points.back().unreadable.empty()) {
      if (!seen_.tables) seen_.tables.emplace();
      lookForTable(message, *seen_.tables);
    }
  }

  Observed& seen_;
  const std::size_t clouds_;  ///< in the bag
  TransformCollector transforms_;
};

}  // namespace

Observed observeBag(const std::string& file, const std::string& topic) {
  if (!std::filesystem::exists(file)) throw std::invalid_argument(file + ": no such file");
  Observed seen;
  seen.source = file;
  readBag(file, [&](rosbag::Bag& bag) {
    rosbag::View view(bag);
    for (const auto* connection : view.getConnections())
      seen.topics[connection->topic].type = connection->datatype;
    if (view.size() > 0) seen.seconds = (view.getEndTime() - view.getBeginTime()).toSec();
    seen.input = topic.empty() ? onlyCloudTopic(seen) : topic;
    seen.camera_info = cameraInfoOf(seen.input, seen.topics);
    seen.clock = seen.topics.count("/clock") > 0;

    rosbag::View clouds(bag, rosbag::TopicQuery(seen.input));
    BagObserver observer(seen, clouds.size());
    rosbag::View needed(bag,
                        rosbag::TopicQuery({seen.input, seen.camera_info, "/tf", "/tf_static"}));
    for (const auto& instance : needed) observer.add(instance);
    observer.finish();
  });
  return seen;
}

}  // namespace tabletop_perception::tools
