#include <sys/resource.h>

#include <cstdio>
#include <exception>
#include <mutex>
#include <string>
#include <vector>

#include <nodelet/loader.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/PointCloud2.h>

#include "cloud_message.h"
#include "conversions.h"
#include "tabletop_perception/frame_memory.h"
#include "tabletop_perception/pipeline.h"

/// What passing clouds between nodelets costs: `graph_cost BAG` is the manager of filter, table and
/// cluster while somebody plays the bag, and then does the same work in one call after the other.
/// Prints the CPU time of both per frame [ms] and their ratio.
namespace tabletop_perception {
namespace {

/// CPU time of this process until now [ms].
double cpuMs() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto ms = [](const timeval& time) { return time.tv_sec * 1e3 + time.tv_usec * 1e-3; };
  return ms(usage.ru_utime) + ms(usage.ru_stime);
}

/// CPU time over a number of frames.
struct Cost {
  double ms = 0;
  int frames = 0;
  double perFrame() const { return ms / frames; }
};

/// Counts from the end of one frame to that of another.
class CostMeter {
 public:
  void frameDone() {
    const std::lock_guard<std::mutex> lock(mutex_);
    last_ms_ = cpuMs();
    last_time_ = ros::WallTime::now();
    if (frames_++ == WARM_UP) first_ms_ = last_ms_;
  }
  bool quiet(double seconds) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return frames_ > 0 && ros::WallTime::now() - last_time_ > ros::WallDuration(seconds);
  }
  Cost cost() const { return {last_ms_ - first_ms_, frames_ - 1 - WARM_UP}; }

 private:
  static constexpr int WARM_UP = 3;  // frames

  mutable std::mutex mutex_;
  ros::WallTime last_time_;
  double first_ms_ = 0, last_ms_ = 0;
  int frames_ = 0;
};

/// Runs the nodelets until the bag has been played.
Cost costOfGraph(const std::string& topic) {
  nodelet::Loader manager(false);
  const auto load = [&](const std::string& name, const std::string& input) {
    const std::string own = "/" + name;
    if (!manager.load(own, "tabletop_perception/" + name, {{own + "/input", input}}, {}))
      throw std::runtime_error(name + " cannot be loaded");
  };
  load("filter", topic);
  load("table", "/filter/cloud");
  load("cluster", "/table/objects");

  CostMeter meter;
  ros::NodeHandle nh;
  const auto subscriber = nh.subscribe<CloudMessage>(
      "/cluster/clusters", 5, [&](const CloudMessageConstPtr&) { meter.frameDone(); });
  std::puts("ready");
  std::fflush(stdout);
  while (ros::ok() && !meter.quiet(3)) {
    ros::spinOnce();
    ros::WallDuration(0.01).sleep();
  }
  return meter.cost();
}

Cost costOfCalls(const rosbag::Bag& bag) {
  CostMeter meter;
  for (const auto& item : rosbag::View(bag, rosbag::TypeQuery("sensor_msgs/PointCloud2"))) {
    const auto message = item.instantiate<sensor_msgs::PointCloud2>();
    const Cloud cloud = cloudFromMessage(*message);
    const auto labels = segmentScene(cloud, std::nullopt, PipelineOptions()).labels();
    if (labels.size() != cloud.size()) throw std::logic_error("labels and points differ in number");
    meter.frameDone();
  }
  return meter.cost();
}

int run(const std::string& file) {
  const rosbag::Bag bag(file);
  const auto connections =
      rosbag::View(bag, rosbag::TypeQuery("sensor_msgs/PointCloud2")).getConnections();
  if (connections.empty()) throw std::invalid_argument(file + ": no PointCloud2 in the bag");
  const Cost graph = costOfGraph(connections.front()->topic);
  const Cost calls = costOfCalls(bag);
  if (graph.frames < 1 || calls.frames < 1)
    throw std::runtime_error("too few frames came through: " + std::to_string(graph.frames));
  std::printf("nodelets    %6.2f ms CPU per frame, %d frames\n", graph.perFrame(), graph.frames);
  std::printf("one process %6.2f ms CPU per frame, %d frames\n", calls.perFrame(), calls.frames);
  std::printf("ratio       %6.2f\n", graph.perFrame() / calls.perFrame());
  return 0;
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  ros::init(argc, argv, "graph_cost");
  tabletop_perception::keepFrameMemory();  // as the nodelets do
  if (argc != 2) {
    std::fprintf(stderr, "usage: graph_cost BAG\n");
    return 2;
  }
  try {
    return tabletop_perception::run(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "graph_cost: %s\n", error.what());
    return 2;
  }
}
