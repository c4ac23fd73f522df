// `tabletop doctor` beside a running graph into which faults are brought.
#include <gtest/gtest.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/Image.h>
#include <sys/wait.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <array>
#include <cstdio>
#include <future>
#include <optional>
#include <set>

#include <nlohmann/json.hpp>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;
using nlohmann::json;

struct Diagnosis {
  int exit_code = -1;
  json result;

  std::set<std::string> ids() const {
    std::set<std::string> ids;
    for (const auto& finding : result.at("findings")) ids.insert(finding.at("id"));
    return ids;
  }

  /// Without what a busy machine may add by itself.
  std::set<std::string> injected() const {
    auto ids = this->ids();
    for (const auto* of_load : {"stamp_old", "network_slow", "answers_slow", "stage_silent"})
      ids.erase(of_load);
    return ids;
  }
  std::string textOf(const std::string& id) const {
    for (const auto& finding : result.at("findings"))
      if (finding.at("id") == id) return finding.at("text");
    return "";
  }
};

Diagnosis runDoctor(const std::string& arguments, const std::string& environment = "") {
  const std::string command =
      environment + " '" TABLETOP_PROGRAM "' doctor --json --seconds 2 " + arguments;
  Diagnosis diagnosis;
  std::FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return diagnosis;
  std::string out;
  std::array<char, 4096> part;
  while (std::fgets(part.data(), part.size(), pipe)) out += part.data();
  const int status = pclose(pipe);
  diagnosis.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  diagnosis.result = out.empty() ? json{{"findings", json::array()}} : json::parse(out);
  return diagnosis;
}

using Ids = std::set<std::string>;

/// A graph whose database is missing and whose up_frame, `base`, nobody publishes at first. The
/// tests follow each other: one mends what the next no longer wants.
class Doctor : public testing::Test {
 protected:
  static void TearDownTestSuite() { std::filesystem::remove(databaseFile()); }

  /// Looks at the graph while `camera` sends clouds, at 5 Hz, or nothing.
  static Diagnosis diagnosis(Camera* camera, const std::string& arguments = "") {
    auto running = std::async(std::launch::async, [&] { return runDoctor(arguments); });
    while (running.wait_for(std::chrono::milliseconds(200)) != std::future_status::ready) {
      if (camera) camera->send(message_);
      ros::spinOnce();
    }
    return running.get();
  }

  static scene::SyntheticScene smallScene() {
    scene::SceneOptions options;
    options.projection = {131, 131, 79.5, 59.5, 160, 120, 1};
    return scene::threeObjects(options);
  }

  inline static const scene::SyntheticScene scene_ = smallScene();
  inline static const sensor_msgs::PointCloud2 message_ =
      *messageFromCloud(scene_.cloud, std_msgs::Header());

  ros::NodeHandle nh_;
};

TEST_F(Doctor, NamesTheTopicThatExistsWhereTheFilterListensToAnother) {
  // the whole graph is up
  ASSERT_TRUE(spinUntil([] {
    ros::master::V_TopicInfo topics;
    ros::master::getTopics(topics);
    return std::any_of(topics.begin(), topics.end(), [](const auto& topic) {
      return topic.name == "/perception/refine/objects";
    });
  }));
  Camera camera(nh_, "/kinect/points");
  const auto found = diagnosis(&camera);
  EXPECT_EQ(found.exit_code, 1);
  EXPECT_EQ(found.injected(), Ids({"wrong_topic", "database_missing"})) << found.result;
  const auto text = found.textOf("wrong_topic");
  EXPECT_NE(text.find("/camera/depth_registered/points"), text.npos) << text;
  EXPECT_NE(text.find("/kinect/points"), text.npos) << text;
}

TEST_F(Doctor, NamesATopicOfAnotherType) {
  const auto images = nh_.advertise<sensor_msgs::Image>("/camera/depth_registered/points", 1);
  const auto found = diagnosis(nullptr);
  EXPECT_EQ(found.injected(), Ids({"wrong_type", "database_missing"})) << found.result;
  EXPECT_NE(found.textOf("wrong_type").find("sensor_msgs/Image"), std::string::npos);
}

TEST_F(Doctor, NamesACameraThatSendsNothing) {
  Camera camera(nh_);
  const auto found = diagnosis(nullptr);
  EXPECT_EQ(found.injected(), Ids({"camera_silent", "database_missing"})) << found.result;
}

TEST_F(Doctor, NamesMissingTransformsAndAnEmptyDatabase) {
  ObjectDatabase(databaseFile(), ObjectDatabase::Mode::WRITE);
  Camera camera(nh_);
  const auto found = diagnosis(&camera);
  EXPECT_EQ(found.injected(), Ids({"tf_missing", "database_empty"})) << found.result;
  EXPECT_NE(found.textOf("database_empty").find(databaseFile()), std::string::npos);
  EXPECT_NE(found.textOf("tf_missing").find("base"), std::string::npos);
}

TEST_F(Doctor, FindsNothingWhereNothingIsWrong) {
  trainObjects({scene_.objects[0]}, databaseFile());
  static tf2_ros::StaticTransformBroadcaster broadcaster;
  std_msgs::Header header;
  header.frame_id = "base";
  header.stamp = ros::Time::now();
  broadcaster.sendTransform(
      transformMessage(messageFromPose(scene_.T_camera_table.inverse()), header, "camera"));
  Camera camera(nh_);
  auto found = diagnosis(&camera);
  EXPECT_EQ(found.injected(), Ids()) << found.result;
  for (int i = 0; i < 5 && !found.ids().empty(); ++i) found = diagnosis(&camera);  // a busy machine
  EXPECT_EQ(found.exit_code, 0);
  EXPECT_EQ(found.ids(), Ids()) << found.result;
  EXPECT_GE(found.result.at("clouds"), 3);
  EXPECT_EQ(found.result.at("input"), "/camera/depth_registered/points");
}

TEST_F(Doctor, AnUpThatNobodyStatesIsAHint) {
  Camera camera(nh_);
  ros::param::set("/perception/table/up_frame", "");
  auto found = diagnosis(&camera);
  for (int i = 0; i < 5 && found.ids().size() > 1; ++i) found = diagnosis(&camera);
  ros::param::set("/perception/table/up_frame", "base");
  EXPECT_EQ(found.ids(), Ids({"up_unknown"})) << found.result;
  EXPECT_EQ(found.exit_code, 0);
}

TEST_F(Doctor, NamesSimulatedTimeThatNobodyGives) {
  ros::param::set("/use_sim_time", true);  // for nodes that start from now on: the doctor
  Camera camera(nh_);
  const auto found = diagnosis(&camera);
  ros::param::del("/use_sim_time");
  EXPECT_EQ(found.injected(), Ids({"sim_time_without_clock"})) << found.result;
}

TEST_F(Doctor, NamesAClockThatNobodyFollows) {
  auto clock = nh_.advertise<rosgraph_msgs::Clock>("/clock", 1, true);
  rosgraph_msgs::Clock message;
  message.clock = ros::Time(5);
  clock.publish(message);
  Camera camera(nh_);
  const auto found = diagnosis(&camera);
  EXPECT_EQ(found.injected(), Ids({"clock_without_sim_time"})) << found.result;
}

TEST_F(Doctor, NamesANamespaceWithoutAGraphAndTheOneThatHasIt) {
  const auto found = diagnosis(nullptr, "--namespace /nowhere");
  EXPECT_EQ(found.injected(), Ids({"graph_missing"})) << found.result;
  EXPECT_NE(found.textOf("graph_missing").find("--namespace /perception"), std::string::npos);
}

TEST_F(Doctor, NamesANodeThatDiedAndIsStillRegistered) {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = "/perception/pick";
  request[1] = "/perception/pick/cloud";
  request[2] = "sensor_msgs/PointCloud2";
  request[3] = "http://localhost:9";
  ASSERT_TRUE(ros::master::execute("registerPublisher", request, response, payload, false));
  Camera camera(nh_);
  const auto found = diagnosis(&camera);
  EXPECT_EQ(found.injected(), Ids({"node_unreachable"})) << found.result;
  EXPECT_NE(found.textOf("node_unreachable").find("/perception/pick"), std::string::npos);
  request[2] = request[3];
  XmlRpc::XmlRpcValue unregister;
  for (int i = 0; i < 3; ++i) unregister[i] = request[i];
  ros::master::execute("unregisterPublisher", unregister, response, payload, false);
}

TEST_F(Doctor, NamesAMasterThatDoesNotAnswer) {
  const auto found = runDoctor("", "ROS_MASTER_URI=http://localhost:9");
  EXPECT_EQ(found.exit_code, 1);
  EXPECT_EQ(found.injected(), Ids({"no_master"}));
  EXPECT_NE(found.textOf("no_master").find("http://localhost:9"), std::string::npos);
}

TEST_F(Doctor, RefusesAnAddressThatIsNone) {
  EXPECT_EQ(runDoctor("2>/dev/null", "ROS_MASTER_URI=localhost").exit_code, 2);
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "doctor_test");
  return RUN_ALL_TESTS();
}
