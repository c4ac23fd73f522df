#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <limits>

#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// A running graph that was trained on the scene of three objects.
class BadInput : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    trainObjects(scene::threeObjects().objects, databaseFile());
    ASSERT_TRUE(warmUp(scene::threeObjects().cloud, shared().camera, shared().objects));
  }
  static void TearDownTestSuite() { std::filesystem::remove(databaseFile()); }

  struct Shared {
    ros::NodeHandle nh;
    Camera camera{nh};
    Recorder<RecognizedObjectArray> objects{nh, "/perception/refine/objects"};
    Recorder<TableMessage> tables{nh, "/perception/table/table"};
    LogRecorder log{nh};
  };
  static Shared& shared() {
    static Shared shared;
    return shared;
  }

  /// After whatever came before, the graph still does its work.
  void TearDown() override {
    const auto frame = answerTo(good_scene_.cloud, camera_, objects_);
    ASSERT_TRUE(frame) << "the next good frame does not come through";
    EXPECT_EQ(named(*frame), 3);
  }

  static int named(const RecognizedObjectArray& frame) {
    return std::count_if(frame.objects.begin(), frame.objects.end(),
                         [](const auto& object) { return object.name != "unknown"; });
  }

  RecognizedObjectArrayConstPtr answer(const Cloud& cloud) {
    return answerTo(cloud, camera_, objects_);
  }
  RecognizedObjectArrayConstPtr answer(const sensor_msgs::PointCloud2& message) {
    return answerTo(message, camera_, objects_);
  }

  /// Sends a message that cannot be read until the log says why.
  bool warned(const sensor_msgs::PointCloud2& message, const std::string& part) {
    shared().log.clear();
    for (int i = 0; i < 30 && !shared().log.has(part); ++i) {
      camera_.send(message);
      spinUntil([&] { return shared().log.has(part); }, 0.5);
    }
    return shared().log.has(part);
  }

  GetObjectPose::Response call(const std::string& name, const std::string& target_frame = "") {
    GetObjectPose::Request request;
    request.name = name;
    request.target_frame = target_frame;
    request.timeout = ros::Duration(4);
    return getObjectPose("/perception/refine/get_object_pose", request, &camera_,
                         good_scene_.cloud);
  }

  const scene::SyntheticScene good_scene_ = scene::threeObjects();
  const sensor_msgs::PointCloud2 good_message_ =
      *messageFromCloud(good_scene_.cloud, std_msgs::Header());
  Camera& camera_ = shared().camera;
  Recorder<RecognizedObjectArray>& objects_ = shared().objects;
};

/// Overwrites one coordinate of every `step`th point.
void spoil(sensor_msgs::PointCloud2& message, std::size_t step, float value) {
  for (std::size_t i = 0; i < message.data.size(); i += step * message.point_step)
    std::memcpy(&message.data[i + 4], &value, sizeof value);
}

TEST_F(BadInput, infiniteAndNanAmongGoodPointsDoNotMatter) {
  auto message = good_message_;
  spoil(message, 97, std::numeric_limits<float>::quiet_NaN());
  spoil(message, 101, std::numeric_limits<float>::infinity());
  const auto frame = answer(message);
  ASSERT_TRUE(frame);
  EXPECT_EQ(named(*frame), 3) << frame->reason;
}

TEST_F(BadInput, allNanIsAnsweredWithAReason) {
  const auto frame = answer(Cloud(640, 480, true));
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->objects.empty());
  EXPECT_FALSE(frame->reason.empty());
  EXPECT_FALSE(shared().tables.at(frame->header.stamp)->found);
}

TEST_F(BadInput, zeroPointsAreAnsweredWithAReason) {
  const auto frame = answer(Cloud(0, 0, false));
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->objects.empty());
  EXPECT_FALSE(frame->reason.empty());
}

TEST_F(BadInput, aCloudWithoutCoordinatesIsSkippedWithAWarning) {
  auto message = good_message_;
  message.fields[0].name = "intensity";
  EXPECT_TRUE(warned(message, "x"));
}

TEST_F(BadInput, aRowStepThatLiesIsSkippedWithAWarning) {
  auto message = good_message_;
  message.row_step = 17;
  EXPECT_TRUE(warned(message, "row_step"));
}

TEST_F(BadInput, aMessageCutShortIsSkippedWithAWarning) {
  auto message = good_message_;
  message.data.resize(message.data.size() / 2);
  EXPECT_TRUE(warned(message, "data"));
}

TEST_F(BadInput, bigEndianIsUnderstood) {
  auto message = good_message_;
  message.is_bigendian = true;
  for (std::size_t i = 0; i < message.data.size(); i += 4)
    std::reverse(message.data.begin() + i, message.data.begin() + i + 4);
  const auto frame = answer(message);
  ASSERT_TRUE(frame);
  EXPECT_EQ(named(*frame), 3) << frame->reason;
}

TEST_F(BadInput, paddingIsUnderstood) {
  auto message = good_message_;
  message.point_step = 48;
  message.row_step = 48 * message.width + 100;
  message.data.assign(std::size_t{message.row_step} * message.height, 0xEE);
  for (std::size_t row = 0; row < message.height; ++row)
    for (std::size_t column = 0; column < message.width; ++column)
      std::copy_n(
          &good_message_.data[row * good_message_.row_step + column * good_message_.point_step],
          good_message_.point_step,
          &message.data[row * message.row_step + column * message.point_step]);
  const auto frame = answer(message);
  ASSERT_TRUE(frame);
  EXPECT_EQ(named(*frame), 3) << frame->reason;
}

TEST_F(BadInput, anUnorganisedCloudWorks) {
  const auto frame = answer(selectPoints(good_scene_.cloud, validIndices(good_scene_.cloud)));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->objects.size(), 3u) << frame->reason;
}

TEST_F(BadInput, noTableIsAnsweredWithAReason) {
  scene::SceneOptions options;
  options.table_x = options.table_y = 0;
  const auto frame = answer(scene::render({}, options).cloud);
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->objects.empty());
  EXPECT_FALSE(frame->reason.empty());
  EXPECT_FALSE(shared().tables.at(frame->header.stamp)->found);
}

TEST_F(BadInput, nothingOnTheTableIsAnsweredWithAReason) {
  const auto frame = answer(scene::render({}).cloud);
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->objects.empty());
  EXPECT_NE(frame->reason.find("nothing stands on it"), std::string::npos) << frame->reason;
  EXPECT_TRUE(shared().tables.at(frame->header.stamp)->found);
}

/// Moves the database away and puts it back.
class WithoutDatabase {
 public:
  WithoutDatabase() { std::filesystem::rename(databaseFile(), away()); }
  ~WithoutDatabase() { std::filesystem::rename(away(), databaseFile()); }

 private:
  static std::filesystem::path away() { return databaseFile().string() + ".away"; }
};

TEST_F(BadInput, aMissingDatabaseIsNamedAndFoundAgain) {
  WithoutDatabase without;
  const auto frame = answer(good_scene_.cloud);
  ASSERT_TRUE(frame);
  EXPECT_GE(frame->objects.size(), 3u);  // nobody knows that parts cut at a hollow are one
  EXPECT_EQ(named(*frame), 0);
  EXPECT_NE(frame->reason.find(databaseFile().string()), std::string::npos) << frame->reason;
  EXPECT_FALSE(call("house").success);
  EXPECT_NE(call("house").reason.find(databaseFile().string()), std::string::npos);
}

TEST_F(BadInput, anEmptyDatabaseIsNamed) {
  WithoutDatabase without;
  ObjectDatabase(databaseFile(), ObjectDatabase::Mode::WRITE);
  const auto frame = answer(good_scene_.cloud);
  ASSERT_TRUE(frame);
  EXPECT_EQ(named(*frame), 0);
  EXPECT_NE(frame->reason.find("no object"), std::string::npos) << frame->reason;
}

TEST_F(BadInput, aBrokenDatabaseIsNamed) {
  WithoutDatabase without;
  std::ofstream(databaseFile()) << std::string(10000, 'x');
  const auto frame = answer(good_scene_.cloud);
  ASSERT_TRUE(frame);
  EXPECT_EQ(named(*frame), 0);
  EXPECT_NE(frame->reason.find(databaseFile().string()), std::string::npos) << frame->reason;
}

TEST_F(BadInput, anUnknownNameIsAnsweredWithTheKnownOnes) {
  const auto reply = call("hose");
  EXPECT_FALSE(reply.success);
  EXPECT_NE(reply.reason.find("hose"), std::string::npos) << reply.reason;
  EXPECT_NE(reply.reason.find("house"), std::string::npos) << reply.reason;
}

TEST_F(BadInput, anUnknownTargetFrameIsAnsweredWithIt) {
  const auto reply = call("house", "no_such_frame");
  EXPECT_FALSE(reply.success);
  EXPECT_NE(reply.reason.find("no_such_frame"), std::string::npos) << reply.reason;
}

TEST_F(BadInput, aNegativeTimeoutIsRefused) {
  GetObjectPose call;
  call.request.timeout = ros::Duration(-1);
  ASSERT_TRUE(ros::service::call("/perception/refine/get_object_pose", call));
  EXPECT_FALSE(call.response.success);
  EXPECT_NE(call.response.reason.find("timeout"), std::string::npos) << call.response.reason;
}

/// The second graph of the launch file: it sleeps until it is asked, and waits for tf to say where
/// up is.
class Sleeping : public testing::Test {
 protected:
  static GetObjectPose::Response call(double timeout, const std::string& name, Camera* camera) {
    GetObjectPose::Request request;
    request.name = name;
    request.timeout = ros::Duration(timeout);
    return getObjectPose("/sleeping/refine/get_object_pose", request, camera,
                         scene::threeObjects().cloud);
  }

  ros::NodeHandle nh_;
  Camera camera_{nh_, "/sleeping_camera"};
};

TEST_F(Sleeping, nothingIsSubscribedUntilACallWakesItUp) {
  ASSERT_TRUE(ros::service::waitForService("/sleeping/refine/get_object_pose", 10000));
  EXPECT_FALSE(spinUntil([&] { return camera_.connected(); }, 2));
  const auto start = ros::WallTime::now();
  const auto reply = call(2, "", nullptr);
  EXPECT_FALSE(reply.success);
  EXPECT_NE(reply.reason.find("no frame"), std::string::npos) << reply.reason;
  EXPECT_NEAR((ros::WallTime::now() - start).toSec(), 2, 0.5);
  EXPECT_TRUE(spinUntil([&] { return !camera_.connected(); }, 5)) << "and then it sleeps again";
}

TEST_F(Sleeping, withoutTfTheReasonNamesTheFrame) {
  const auto reply = call(6, "", &camera_);
  EXPECT_FALSE(reply.success);
  EXPECT_NE(reply.reason.find("nowhere"), std::string::npos) << reply.reason;
}

TEST_F(Sleeping, withTfAServiceCallAloneGivesPoses) {
  trainObjects(scene::threeObjects().objects, databaseFile());
  const scene::SyntheticScene truth = scene::threeObjects();
  tf2_ros::StaticTransformBroadcaster broadcaster;
  std_msgs::Header header;
  header.frame_id = "camera";
  header.stamp = ros::Time::now();
  broadcaster.sendTransform(
      transformMessage(messageFromPose(truth.T_camera_table), header, "nowhere"));
  spinUntil([] { return false; }, 1);

  int sent = 0;
  const auto tf = nh_.subscribe<tf2_msgs::TFMessage>(
      "/tf", 100, [&](const tf2_msgs::TFMessageConstPtr&) { ++sent; });
  const auto reply = call(8, "house", &camera_);
  ASSERT_TRUE(reply.success) << reply.reason;
  EXPECT_EQ(reply.objects.size(), 1u);
  EXPECT_EQ(tf.getNumPublishers(), 2u) << "the managers of both graphs";
  EXPECT_EQ(sent, 0) << "publish_tf is false";
  std::filesystem::remove(databaseFile());
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "bad_input_test");
  return RUN_ALL_TESTS();
}
