#pragma once

#include <atomic>
#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <sensor_msgs/PointCloud2.h>

#include "conversions.h"
#include "messages.h"
#include "scene.h"
#include "tabletop_perception/database.h"
#include "tabletop_perception/train.h"

/// A running graph as the tests see it: a camera at its entrance, recorders at its outputs.
namespace tabletop_perception::test {

/// Spins until the condition holds; false if it does not within `seconds`.
template <typename Condition>
bool spinUntil(Condition condition, double seconds = 15) {
  const auto end = ros::WallTime::now() + ros::WallDuration(seconds);
  while (!condition() && ros::WallTime::now() < end) {
    ros::spinOnce();
    ros::WallDuration(0.005).sleep();
  }
  return condition();
}

/// Every message of a topic, by its stamp.
template <typename Message>
class Recorder {
 public:
  Recorder(ros::NodeHandle& nh, const std::string& topic)
      : subscriber_(nh.subscribe<Message, const Event&>(
            topic, 100, boost::function<void(const Event&)>([this](const Event& event) {
              const auto message = event.getConstMessage();
              by_stamp_[message->header.stamp] = message;
              received_[message->header.stamp] = event.getReceiptTime();
            }))) {}

  bool has(const ros::Time& stamp) const { return by_stamp_.count(stamp) > 0; }
  boost::shared_ptr<const Message> at(const ros::Time& stamp) const { return by_stamp_.at(stamp); }
  const auto& all() const { return by_stamp_; }
  /// When each of them came here, whether this process was ready for it or not.
  const std::map<ros::Time, ros::Time>& received() const { return received_; }

 private:
  using Event = ros::MessageEvent<const Message>;

  std::map<ros::Time, boost::shared_ptr<const Message>> by_stamp_;
  std::map<ros::Time, ros::Time> received_;
  ros::Subscriber subscriber_;
};

/// Warnings and errors of all nodes.
class LogRecorder {
 public:
  explicit LogRecorder(ros::NodeHandle& nh)
      : subscriber_(nh.subscribe<rosgraph_msgs::Log>("/rosout", 100, [this](const auto& message) {
          if (message->level >= rosgraph_msgs::Log::WARN) texts_.push_back(message->msg);
        })) {}

  bool has(const std::string& part) const {
    for (const auto& text : texts_)
      if (text.find(part) != std::string::npos) return true;
    return false;
  }
  /// Whether other nodes than this one are heard.
  bool connected() const { return subscriber_.getNumPublishers() > 1; }
  void clear() { texts_.clear(); }
  const std::vector<std::string>& texts() const { return texts_; }

 private:
  std::vector<std::string> texts_;
  ros::Subscriber subscriber_;
};

/// Publishes clouds where perception.launch expects them.
class Camera {
 public:
  explicit Camera(ros::NodeHandle& nh, const std::string& topic = "/camera/depth_registered/points")
      : publisher_(nh.advertise<sensor_msgs::PointCloud2>(topic, 1)) {}

  bool connected() const { return publisher_.getNumSubscribers() > 0; }

  /// Stamps and sends a message; gives back the stamp.
  ros::Time send(sensor_msgs::PointCloud2 message, const ros::Time& stamp = ros::Time::now()) {
    message.header.stamp = stamp;
    message.header.frame_id = frame;
    publisher_.publish(message);
    return message.header.stamp;
  }
  ros::Time send(const Cloud& cloud, const ros::Time& stamp = ros::Time::now()) {
    return send(*messageFromCloud(cloud, std_msgs::Header()), stamp);
  }

  std::string frame = "camera";

 private:
  ros::Publisher publisher_;
};

/// The answer of the graph to one frame, or null.
template <typename Frame>
RecognizedObjectArrayConstPtr answerTo(const Frame& frame, Camera& camera,
                                       const Recorder<RecognizedObjectArray>& objects) {
  const ros::Time stamp = camera.send(frame);
  return spinUntil([&] { return objects.has(stamp); }) ? objects.at(stamp) : nullptr;
}

/// Sends frames until one comes through: every topic is connected then.
template <typename Frame>
bool warmUp(const Frame& frame, Camera& camera, const Recorder<RecognizedObjectArray>& objects) {
  const std::size_t before = objects.all().size();
  for (int i = 0; i < 40; ++i) {
    camera.send(frame);
    if (spinUntil([&] { return objects.all().size() > before; }, 0.5)) break;
  }
  spinUntil([] { return false; }, 1);  // what is still on its way
  return objects.all().size() > before;
}

/// Calls the service of a graph while `camera` sends `cloud` every half second, or nothing.
inline GetObjectPose::Response getObjectPose(const std::string& service,
                                             const GetObjectPose::Request& request, Camera* camera,
                                             const Cloud& cloud) {
  GetObjectPose call;
  call.request = request;
  std::atomic<bool> done{false};
  std::thread client([&] {
    if (!ros::service::call(service, call)) call.response.reason = "the service did not answer";
    done = true;
  });
  while (!done) {
    if (camera) camera->send(cloud);
    spinUntil([&] { return done.load(); }, 0.5);
  }
  client.join();
  if (camera) spinUntil([] { return false; }, 1);  // frames that are still on their way
  return call.response;
}

/// The file that the running graph reads its objects from.
inline std::filesystem::path databaseFile() {
  std::string file;
  ros::NodeHandle().getParam("/perception/match/database", file);
  return file;
}

/// Trains the meshes of a scene into a new database.
inline void trainObjects(const std::vector<scene::Placed>& objects,
                         const std::filesystem::path& file) {
  std::filesystem::remove(file);
  ObjectDatabase database(file, ObjectDatabase::Mode::WRITE);
  for (const auto& object : objects)
    database.store(trainFromMesh(object.name, object.mesh, {}, [](double) {}));
}

}  // namespace tabletop_perception::test
