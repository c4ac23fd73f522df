#include <gtest/gtest.h>

#include <csignal>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include <ros/master.h>
#include <ros/network.h>
#include <rosgraph_msgs/Clock.h>
#include <tf2_ros/transform_listener.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// The time of all nodes.
class SimClock {
 public:
  explicit SimClock(ros::NodeHandle& nh)
      : publisher_(nh.advertise<rosgraph_msgs::Clock>("/clock", 10)) {}

  void set(double seconds) {
    rosgraph_msgs::Clock clock;
    clock.clock = ros::Time(seconds);
    publisher_.publish(clock);
    ASSERT_TRUE(spinUntil([&] { return ros::Time::now() == clock.clock; }));
    spinUntil([] { return false; }, 0.1);  // the others hear of it, too
  }

 private:
  ros::Publisher publisher_;
};

/// A camera, a clock and the graph behind, which knows the objects of the scene.
class Recovery : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    trainObjects(scene::threeObjects().objects, databaseFile());
    shared().clock.set(1000);
    ASSERT_TRUE(flows(1000));
  }
  static void TearDownTestSuite() { std::filesystem::remove(databaseFile()); }

  struct Shared {
    ros::NodeHandle nh;
    SimClock clock{nh};
    std::optional<Camera> camera{nh};
    Recorder<RecognizedObjectArray> objects{nh, "/perception/refine/objects"};
    tf2_ros::Buffer tf;
    tf2_ros::TransformListener tf_listener{tf};
  };
  static Shared& shared() {
    static Shared shared;
    return shared;
  }

  /// Sends frames from a time on, a tenth of a second apart, until one is answered.
  static bool flows(double& time) {
    const std::size_t before = shared().objects.all().size();
    for (int i = 0; i < 120 && shared().objects.all().size() == before; ++i) {
      time += 0.1;
      shared().clock.set(time);
      shared().camera->send(cloud());
      spinUntil([&] { return shared().objects.all().size() > before; }, 0.4);
    }
    const bool flowing = shared().objects.all().size() > before;
    for (std::size_t seen = 0; flowing && seen < shared().objects.all().size();) {
      seen = shared().objects.all().size();  // what is still on its way
      spinUntil([&] { return shared().objects.all().size() > seen; }, 1.5);
    }
    return flowing;
  }
  static bool flows(double&& time) { return flows(time); }

  /// The answer to a frame of that time, or null.
  static RecognizedObjectArrayConstPtr answerAt(double time) {
    shared().clock.set(time);
    return answerTo(cloud(), *shared().camera, shared().objects);
  }

  static const Cloud& cloud() {
    static const Cloud cloud = scene::threeObjects().cloud;
    return cloud;
  }

  static std::set<std::string> framesOf(const RecognizedObjectArray& frame) {
    std::set<std::string> frames;
    for (const auto& object : frame.objects) frames.insert(object.child_frame_id);
    return frames;
  }
};

TEST_F(Recovery, aClockThatIsSetBackChangesNothing) {
  RecognizedObjectArrayConstPtr before;
  for (const double time : {2000.0, 2000.5, 2001.0, 2001.5}) {
    before = answerAt(time);
    ASSERT_TRUE(before);
  }
  const auto after = answerAt(1500);
  ASSERT_TRUE(after) << "the first frame after the jump is answered";
  ASSERT_EQ(after->objects.size(), 3u);
  EXPECT_EQ(framesOf(*after), framesOf(*before));
  for (const auto& object : after->objects) {
    EXPECT_TRUE(object.confirmed) << object.child_frame_id;
    EXPECT_TRUE(spinUntil([&] {
      return shared().tf.canTransform("camera", object.child_frame_id, after->header.stamp);
    })) << object.child_frame_id;
  }
}

TEST_F(Recovery, aCallIsAnsweredAcrossAClockThatIsSetBack) {
  shared().clock.set(3000);
  auto answer = std::async(std::launch::async, [] {
    GetObjectPose call;
    call.request.timeout = ros::Duration(20);
    ros::service::call("/perception/refine/get_object_pose", call);
    return call.response;
  });
  spinUntil([] { return false; }, 0.5);  // it waits
  for (double time = 2500; time < 2503; time += 0.5) answerAt(time);
  ASSERT_EQ(answer.wait_for(std::chrono::seconds(1)), std::future_status::ready);
  const auto response = answer.get();
  EXPECT_TRUE(response.success) << response.reason;
}

TEST_F(Recovery, aCameraThatComesBackFindsTheSameThings) {
  const auto before = answerAt(4000);
  ASSERT_TRUE(before);
  shared().camera.reset();
  spinUntil([] { return false; }, 0.5);
  shared().camera.emplace(shared().nh);
  double time = 4001;
  ASSERT_TRUE(flows(time));
  const auto after = answerAt(time + 0.1);
  ASSERT_TRUE(after);
  EXPECT_EQ(framesOf(*after), framesOf(*before));
}

/// The process of a node.
int pidOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, payload, none;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, payload, false)) return 0;
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(std::string(payload), host, port)) return 0;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port));
  XmlRpc::XmlRpcValue caller, pid;
  caller[0] = ros::this_node::getName();
  return client.execute("getPid", caller, pid) ? int(pid[2]) : 0;
}

TEST_F(Recovery, aManagerThatIsKilledComesBackWithItsNodelets) {
  ASSERT_TRUE(answerAt(5000));
  const int pid = pidOf("/perception/manager");
  ASSERT_GT(pid, 1);
  ASSERT_EQ(kill(pid, SIGKILL), 0);
  ASSERT_TRUE(spinUntil([&] { return kill(pid, 0) != 0; }));
  double time = 5001;
  ASSERT_TRUE(flows(time));
  const auto after = answerAt(time + 0.1);
  ASSERT_TRUE(after);
  EXPECT_EQ(after->objects.size(), 3u);
}

TEST_F(Recovery, aLoaderThatIsKilledLeavesItsNodeletAndTakesItsPlaceAgain) {
  ASSERT_TRUE(answerAt(6000));
  const int pid = pidOf("/perception/refine");
  ASSERT_GT(pid, 1);
  ASSERT_EQ(kill(pid, SIGKILL), 0);
  EXPECT_TRUE(answerAt(6001)) << "the nodelet lives on";
  EXPECT_TRUE(spinUntil([&] {
    const int other = pidOf("/perception/refine");
    return other > 1 && other != pid;
  }));
  EXPECT_TRUE(flows(6002));
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "recovery_test");
  return RUN_ALL_TESTS();
}
