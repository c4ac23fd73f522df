#include <atomic>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include <unistd.h>

#include <ros/ros.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_msgs/TFMessage.h>
#include <CLI/CLI.hpp>

#include "conversions.h"
#include "judge.h"
#include "messages.h"
#include "process_meter.h"
#include "sequence.h"

/// A camera that plays a simulated sequence to a running graph, to and fro, and a node that holds
/// what comes out of the graph against the truth. scripts/soak starts the graph.
namespace tabletop_perception::soak {
namespace {

constexpr char CAMERA_FRAME[] = "camera";
constexpr char MANAGER[] = "/perception/manager";
constexpr char OBJECTS[] = "/perception/refine/objects";
constexpr char SERVICE[] = "/perception/refine/get_object_pose";
constexpr double WARM_UP = 5;  // until the graph has read its database and met every thread [s]
constexpr double REST = 2;     // after the last cloud, for what is under way [s]
constexpr std::size_t VERTICES = 300;  // of a model that poses are measured with

struct Arguments {
  std::string sequence, models;
  double minutes = 10;
  double rate = 30;    ///< of the camera [Hz]
  double idle = 0;     ///< instead of the run, so long without a listener [s]
  double grace = 0.5;  ///< of the tracker [s]
};

/// Everything that comes of the clouds, in the order of their stamps.
class Recorder {
 public:
  void offered(const ros::Time& stamp, std::size_t picture) {
    const std::lock_guard<std::mutex> lock(mutex_);
    index_[stamp] = clouds_.size();
    clouds_.push_back({stamp.toSec(), picture, std::nullopt, {}, {}});
  }

  void answered(const RecognizedObjectArray& answer) {
    const double now = ros::Time::now().toSec();
    const std::lock_guard<std::mutex> lock(mutex_);
    if (auto* cloud = find(answer.header.stamp)) {
      cloud->answered = now;
      for (const auto& object : answer.objects)
        cloud->objects.push_back({object.name, object.id, poseFromMessage(object.pose)});
    }
  }

  void sent(const tf2_msgs::TFMessage& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& transform : message.transforms) {
      const std::string& child = transform.child_frame_id;
      const auto split = child.rfind('_');
      auto* cloud = find(transform.header.stamp);
      if (!cloud || split == child.npos || transform.header.frame_id != CAMERA_FRAME) continue;
      cloud->frames.push_back({child.substr(0, split),
                               static_cast<std::uint32_t>(std::stoul(child.substr(split + 1))),
                               Eigen::Isometry3d(tf2::transformToEigen(transform))});
    }
  }

  std::vector<OfferedCloud> clouds() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return clouds_;
  }

 private:
  OfferedCloud* find(const ros::Time& stamp) {
    const auto found = index_.find(stamp);
    return found == index_.end() ? nullptr : &clouds_[found->second];
  }

  mutable std::mutex mutex_;
  std::map<ros::Time, std::size_t> index_;
  std::vector<OfferedCloud> clouds_;
};

/// Sends pictures of a sequence as clouds.
class Camera {
 public:
  Camera(ros::NodeHandle& nh, const Sequence& sequence)
      : sequence_(sequence),
        publisher_(nh.advertise<sensor_msgs::PointCloud2>("/camera/depth_registered/points", 1)) {}

  bool heard() const { return publisher_.getNumSubscribers() > 0; }

  /// The stamp is the time at which the cloud leaves; `before` is told first.
  void send(std::size_t picture, const std::function<void(const ros::Time&)>& before) const {
    std_msgs::Header header;
    header.frame_id = CAMERA_FRAME;
    const auto message = messageFromCloud(sequence_.cloud(picture), header);
    message->header.stamp = ros::Time::now();
    before(message->header.stamp);
    publisher_.publish(message);
  }

  /// One picture after the other, at an even pace, for some time. Between them `between` is called.
  void play(double seconds, double rate,
            const std::function<std::size_t(std::size_t step)>& picture,
            const std::function<void(const ros::Time&, std::size_t)>& before) const {
    const auto start = ros::WallTime::now();
    for (std::size_t step = 0; ros::ok(); ++step) {
      const double due = static_cast<double>(step) / rate;
      if (due >= seconds) break;
      const double early = due - (ros::WallTime::now() - start).toSec();
      if (early > 0) ros::WallDuration(early).sleep();
      const std::size_t shown = picture(step);
      send(shown, [&](const ros::Time& stamp) { before(stamp, shown); });
    }
  }

 private:
  const Sequence& sequence_;
  ros::Publisher publisher_;
};

void waitUntil(const std::string& what, const std::function<bool()>& condition) {
  const auto end = ros::WallTime::now() + ros::WallDuration(30);
  while (!condition()) {
    if (ros::WallTime::now() > end) throw std::runtime_error("waited 30 s until " + what);
    ros::WallDuration(0.1).sleep();
  }
}

Models modelsOf(const std::string& folder, const std::set<std::string>& names) {
  Models models;
  for (auto& [name, whole] : tools::readTrueModels(folder, names).reference) {
    const auto& all = whole.vertices.points();
    std::vector<Eigen::Vector3f> some;
    for (std::size_t i = 0; i < all.size(); i += 1 + all.size() / VERTICES) some.push_back(all[i]);
    models.emplace(name, ReferenceModel{KdTree(some), whole.diameter, whole.symmetries});
  }
  return models;
}

int run(const Arguments& arguments, const Sequence& sequence, ros::NodeHandle& nh) {
  Truth truth;
  for (std::size_t i = 0; i < sequence.size(); ++i) truth.push_back(sequence.truth(i));
  const Models models = modelsOf(arguments.models, sequence.names());

  const Camera camera(nh, sequence);
  Recorder recorder;
  const auto objects = nh.subscribe<RecognizedObjectArray>(
      OBJECTS, 100,
      [&](const RecognizedObjectArrayConstPtr& answer) { recorder.answered(*answer); });
  const auto tf = nh.subscribe<tf2_msgs::TFMessage>(
      "/tf", 1000, [&](const tf2_msgs::TFMessageConstPtr& message) { recorder.sent(*message); });
  ros::AsyncSpinner spinner(1);
  spinner.start();
  waitUntil("the graph listens to the camera", [&] { return camera.heard(); });
  waitUntil("somebody publishes the objects", [&] { return objects.getNumPublishers() > 0; });
  camera.play(
      WARM_UP, arguments.rate, [](std::size_t) { return std::size_t{0}; },
      [](const ros::Time&, std::size_t) {});

  const double seconds = 60 * arguments.minutes;
  const int manager = processOf(MANAGER);
  const CpuMeter cpu(manager), own_cpu(getpid());
  const double memory_start = residentMb(manager);
  double memory_half = memory_start;
  std::size_t half = static_cast<std::size_t>(seconds / 2 * arguments.rate);
  camera.play(
      seconds, arguments.rate,
      [&](std::size_t step) {
        if (step == half) memory_half = residentMb(manager);
        return toAndFro(step, sequence.size());
      },
      [&](const ros::Time& stamp, std::size_t picture) { recorder.offered(stamp, picture); });
  const double share = cpu.share(), own_share = own_cpu.share();
  ros::WallDuration(REST).sleep();
  const double memory_end = residentMb(manager);

  JudgeOptions options;
  options.grace = arguments.grace;
  const Verdict verdict = judge(recorder.clouds(), truth, models, options);
  for (const auto& fault : verdict.faults) std::fprintf(stderr, "%s\n", fault.c_str());
  for (const auto& [name, rest] : verdict.rests)
    std::fprintf(stderr, "%s at rest: %zu right frames, %.2f mm %.2f deg (p95)\n", name.c_str(),
                 rest.shifts.size(), 1e3 * tools::spreadOf(rest.shifts).p95,
                 tools::spreadOf(rest.turns).p95 * 180 / M_PI);
  std::printf(
      "soak %.1f min at %.0f Hz: clouds %zu offered %zu processed %zu dropped; "
      "latency %.0f ms p50 %.0f ms p99; manager %.2f cores, camera and judge %.2f; "
      "memory %.0f MB start %.0f half-time %.0f end; id switches %zu; "
      "tf frames %zu sent %zu wrong %zu stale %zu lost %zu flipped; "
      "in plain view %.1f %% with a right frame; at rest %.2f mm %.2f deg (p95)\n",
      arguments.minutes, arguments.rate, verdict.offered, verdict.answered,
      verdict.offered - verdict.answered, 1e3 * verdict.latency_p50, 1e3 * verdict.latency_p99,
      share, own_share, memory_start, memory_half, memory_end, verdict.id_switches, verdict.frames,
      verdict.wrong, verdict.stale, verdict.flickers, verdict.flips,
      verdict.due ? 100.0 * static_cast<double>(verdict.shown) / static_cast<double>(verdict.due)
                  : 0.0,
      1e3 * verdict.shift.p95, verdict.turn.p95 * 180 / M_PI);
  return verdict.id_switches + verdict.wrong + verdict.stale + verdict.flickers + verdict.flips == 0
             ? 0
             : 1;
}

/// The camera runs and nobody listens; then somebody calls the service.
int idle(const Arguments& arguments, const Sequence& sequence, ros::NodeHandle& nh) {
  const Camera camera(nh, sequence);
  waitUntil("the service is there", [] { return ros::service::exists(SERVICE, false); });
  const int manager = processOf(MANAGER);
  const auto first = [](std::size_t) { return std::size_t{0}; };
  const auto nothing = [](const ros::Time&, std::size_t) {};
  camera.play(WARM_UP, arguments.rate, first, nothing);
  if (camera.heard()) throw std::runtime_error("the graph listens although nobody listens to it");
  const CpuMeter cpu(manager);
  camera.play(arguments.idle, arguments.rate, first, nothing);
  const double share = cpu.share();

  GetObjectPose call;
  call.request.timeout = ros::Duration(20);
  std::atomic<bool> done{false};
  ros::WallDuration waited;
  std::thread client([&] {
    const auto start = ros::WallTime::now();
    if (!ros::service::call(SERVICE, call)) call.response.reason = "the service did not answer";
    waited = ros::WallTime::now() - start;
    done = true;
  });
  while (!done) camera.play(0.5, arguments.rate, first, nothing);
  client.join();
  waitUntil("the graph sleeps again", [&] {
    camera.play(0.1, arguments.rate, first, nothing);
    return !camera.heard();
  });
  if (!call.response.reason.empty())
    std::fprintf(stderr, "service: %s\n", call.response.reason.c_str());
  std::printf(
      "idle %.0f s at %.0f Hz: manager %.2f %% of a core; then a service call: %zu objects in "
      "%.2f s\n",
      arguments.idle, arguments.rate, 100 * share, call.response.objects.size(), waited.toSec());
  return call.response.success ? 0 : 1;
}

}  // namespace
}  // namespace tabletop_perception::soak

int main(int argc, char** argv) {
  using namespace tabletop_perception::soak;
  ros::init(argc, argv, "soak", ros::init_options::NoSigintHandler);
  Arguments arguments;
  CLI::App app("plays a simulated sequence to a running graph and judges what comes out");
  app.add_option("sequence", arguments.sequence, "folder of tabletop simulate --sequence")
      ->required();
  app.add_option("models", arguments.models, "folder of NAME/mesh.ply [m]")->required();
  app.add_option("--minutes", arguments.minutes, "how long")->check(CLI::Range(0.05, 1440.0));
  app.add_option("--rate", arguments.rate, "of the camera [Hz]")->check(CLI::Range(0.1, 100.0));
  app.add_option("--grace", arguments.grace, "track/grace of the graph [s]");
  app.add_option("--idle", arguments.idle,
                 "instead, so long without a listener [s], and then a service call");
  CLI11_PARSE(app, argc, argv);
  try {
    ros::NodeHandle nh;
    const Sequence sequence(arguments.sequence);
    return arguments.idle > 0 ? idle(arguments, sequence, nh) : run(arguments, sequence, nh);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "soak: %s\n", error.what());
    return 2;
  }
}
