#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <nodelet/NodeletUnload.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_ros/transform_listener.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>

#include "device_clock.h"
#include "graph.h"
#include "lasting_thread.h"
#include "openni_camera.h"

namespace tabletop_perception {
namespace {

using namespace test;
using namespace std::chrono_literals;

constexpr double MAX_SHIFT = 0.005;          ///< of depths in whole millimetres [m]
constexpr double MAX_TURN = 3 * M_PI / 180;  ///< [rad]

// --- the clock

TEST(DeviceClock, takesAwayJitterAndFollowsDrift) {
  DeviceClock clock;
  double worst = 0;
  for (int frame = 0; frame < 20000; ++frame) {
    const double taken = frame / 30.0;
    const double delay = 0.004 + 0.02 * (frame * 7 % 11) / 11.0;  // on the way here
    const auto device_us = static_cast<std::uint64_t>(1e6 * taken * (1 - 1e-4));
    const double stamp = clock.onHost(device_us, 1000 + taken + delay);
    if (frame > 100) worst = std::max(worst, std::abs(stamp - (1000 + taken + 0.004)));
  }
  EXPECT_LT(worst, 0.005);
}

TEST(DeviceClock, keepsTheDistanceOfTwoImages) {
  DeviceClock clock;
  const double depth = clock.onHost(1000000, 50), color = clock.onHost(1003000, 50.02);
  EXPECT_NEAR(color - depth, 0.003, 1e-4);
}

TEST(DeviceClock, beginsAnewWhereTheTimeJumps) {
  DeviceClock clock;
  clock.onHost(5000000, 50);
  EXPECT_NEAR(clock.onHost(0, 50.1), 50.1, 1e-9) << "a file that begins anew";
  EXPECT_NEAR(clock.onHost(33000, 12), 12, 1e-9) << "a host's clock that was set back";
}

// --- threads

TEST(LastingThread, takesTheNextWorkToo) {
  const auto thread = [] {
    std::thread::id id;
    LastingThread([&] { id = std::this_thread::get_id(); });
    return id;
  };
  const auto first = thread();
  EXPECT_NE(first, std::this_thread::get_id());
  for (int i = 0; i < 100; ++i) ASSERT_EQ(thread(), first);
}

TEST(LastingThread, worksBesideOthers) {
  std::promise<void> met;
  LastingThread one([&] { met.get_future().wait(); });
  LastingThread other([&] { met.set_value(); });  // or this never ends
}

// --- the camera, without ROS

class OpenniCameraTest : public testing::Test {
 protected:
  /// The next image of a sensor.
  static OpenniFrame frameOf(OpenniCamera& camera, bool depth) {
    camera.stream(depth, !depth);
    for (int i = 0; i < 50; ++i)
      if (auto frame = camera.read(100ms)) return *frame;
    throw std::runtime_error("no image in 5 s");
  }

  static std::string refusalOf(const std::string& device, const OpenniOptions& options = {}) {
    try {
      OpenniCamera camera(device, options);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "not refused";
  }

  OpenniLibrary library_;
};

TEST_F(OpenniCameraTest, isFoundByEveryNameOfIt) {
  for (const std::string device : {"", "#1", "synthetic://0", "S1701"})
    EXPECT_EQ(OpenniCamera(device, {}).name(), "synthetic://0 (serial S1701)") << device;
}

TEST_F(OpenniCameraTest, isRefusedWithWhatThereIs) {
  EXPECT_EQ(refusalOf("#2"), "no camera '#2' is connected, there is synthetic://0 (serial S1701)");
  EXPECT_EQ(refusalOf("/nowhere/x.oni"), "/nowhere/x.oni: no such file");
  OpenniOptions options;
  options.width = 641;
  EXPECT_EQ(refusalOf("", options),
            "depth has no mode 641 x 480 at 30 Hz, there is 640 x 480 at 30 Hz");
}

TEST_F(OpenniCameraTest, imagesAreThoseOfTheScene) {
  const auto scene = scene::threeObjects();
  OpenniCamera camera("", {});
  const auto depth = frameOf(camera, true);
  EXPECT_EQ(depth.image.encoding, "16UC1");
  EXPECT_NEAR(depth.camera.fx, 525, 1e-3);
  EXPECT_NEAR(depth.camera.cy, 239.5, 1e-9);
  const auto depths = depthsInMetres(depth.image);
  ASSERT_EQ(depths.size(), scene.cloud.size());
  for (std::size_t i = 0; i < depths.size(); ++i) {
    ASSERT_EQ(!std::isnan(depths[i]), scene.cloud.valid(i));
    if (scene.cloud.valid(i)) {
      ASSERT_NEAR(depths[i], scene.cloud.z[i], 0.00051);
    }
  }
  const auto color = frameOf(camera, false);
  EXPECT_EQ(color.image.encoding, "rgb8");
  for (std::size_t i = 0; i < scene.cloud.size(); i += 97) {
    const auto* rgb = color.image.data + 3 * i;
    ASSERT_EQ(scene.cloud.rgb[i], static_cast<unsigned>(rgb[0] << 16 | rgb[1] << 8 | rgb[2]));
  }
}

TEST_F(OpenniCameraTest, mirrorTurnsTheImageAround) {
  OpenniOptions options;
  const auto plain =
      depthsInMetres(frameOf(*std::make_unique<OpenniCamera>("", options), true).image);
  options.mirror = true;
  const auto mirrored =
      depthsInMetres(frameOf(*std::make_unique<OpenniCamera>("", options), true).image);
  for (int v = 0; v < 480; v += 7)
    for (int u = 0; u < 640; ++u) {
      const float there = mirrored[v * 640 + 639 - u];
      ASSERT_TRUE(plain[v * 640 + u] == there || std::isnan(there)) << u << " " << v;
    }
}

// --- the nodelet and the graph behind it

/// Writes what the camera sends into a file; complete when it has its name.
void record(const std::filesystem::path& file) {
  OpenniLibrary library;
  openni::Device device;
  ASSERT_EQ(device.open(openni::ANY_DEVICE), openni::STATUS_OK);
  device.setImageRegistrationMode(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR);
  openni::VideoStream depth, color;
  ASSERT_EQ(depth.create(device, openni::SENSOR_DEPTH), openni::STATUS_OK);
  ASSERT_EQ(color.create(device, openni::SENSOR_COLOR), openni::STATUS_OK);
  for (auto* stream : {&depth, &color}) stream->setMirroringEnabled(false);
  const std::string growing = file.string() + ".growing.oni";
  openni::Recorder recorder;
  ASSERT_EQ(recorder.create(growing.c_str()), openni::STATUS_OK);
  ASSERT_EQ(recorder.attach(depth), openni::STATUS_OK);
  ASSERT_EQ(recorder.attach(color), openni::STATUS_OK);
  depth.start();
  color.start();
  ASSERT_EQ(recorder.start(), openni::STATUS_OK);
  std::this_thread::sleep_for(1500ms);
  recorder.stop();
  recorder.destroy();
  for (auto* stream : {&depth, &color}) stream->destroy();
  device.close();
  std::filesystem::rename(growing, file);
}

class Openni2 : public testing::Test {
 protected:
  using Objects = Recorder<RecognizedObjectArray>;

  static void SetUpTestSuite() { trainObjects(scene::threeObjects().objects, databaseFile()); }
  static void TearDownTestSuite() {
    std::filesystem::remove(databaseFile());
    std::filesystem::remove(recording());
    std::filesystem::remove(unplugged());
  }

  static std::filesystem::path recording() {
    std::string file;
    ros::NodeHandle().getParam("/recording", file);
    return file;
  }
  static std::filesystem::path unplugged() { return std::getenv("SYNTHETIC_UNPLUGGED"); }

  /// A frame of a graph in which all objects have their names, or null.
  RecognizedObjectArrayConstPtr namedFrame(const std::string& topic, double seconds = 40) {
    Objects objects(nh_, topic);
    RecognizedObjectArrayConstPtr named;
    spinUntil(
        [&] {
          for (const auto& [stamp, frame] : objects.all())
            if (std::count_if(frame->objects.begin(), frame->objects.end(),
                              [](const auto& o) { return o.name != "unknown"; }) == 3)
              named = frame;
          return named != nullptr;
        },
        seconds);
    return named;
  }

  static const RecognizedObject& find(const RecognizedObjectArray& frame, const std::string& name) {
    return *std::find_if(frame.objects.begin(), frame.objects.end(),
                         [&](const auto& object) { return object.name == name; });
  }

  static void expectTruth(const RecognizedObjectArray& frame) {
    for (const auto& truth : scene::threeObjects().objects) {
      SCOPED_TRACE(truth.name);
      const auto pose = poseFromMessage(find(frame, truth.name).pose);
      EXPECT_LT((pose.translation() - truth.T_camera_object.translation()).norm(), MAX_SHIFT);
      EXPECT_LT(angleOf(pose.linear().transpose() * truth.T_camera_object.linear()), MAX_TURN);
    }
  }

  /// Whether diagnostics say of the camera what ends so, from now on.
  bool says(const std::string& end) {
    said_.clear();
    return spinUntil([&] { return said_.find(end + "\n") != std::string::npos; }, 5);
  }

  ros::NodeHandle nh_;
  LogRecorder log_{nh_};
  std::string said_;
  ros::Subscriber diagnostics_ = nh_.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [this](const auto& message) {
        for (const auto& status : message->status)
          if (status.name == "camera: frames") said_ += status.message + "\n";
      });
};

TEST_F(Openni2, imagesAndCloudComeInTheirFramesAndOfOneMoment) {
  Recorder<sensor_msgs::Image> depth(nh_, "/camera/depth_registered/image_raw");
  Recorder<sensor_msgs::Image> metres(nh_, "/camera/depth_registered/image");
  Recorder<sensor_msgs::CameraInfo> depth_info(nh_, "/camera/depth_registered/camera_info");
  Recorder<sensor_msgs::Image> color(nh_, "/camera/rgb/image_raw");
  Recorder<sensor_msgs::CameraInfo> color_info(nh_, "/camera/rgb/camera_info");
  Recorder<sensor_msgs::PointCloud2> clouds(nh_, "/camera/depth_registered/points");
  ASSERT_TRUE(spinUntil(
      [&] {
        return clouds.all().size() > 10 && color_info.all().size() > 10 && metres.all().size() > 10;
      },
      30));

  const auto& [stamp, cloud] = *std::prev(clouds.all().end(), 3);
  EXPECT_EQ(cloud->header.frame_id, "camera_rgb_optical_frame");
  ASSERT_TRUE(depth.has(stamp) && metres.has(stamp) && depth_info.has(stamp));
  EXPECT_EQ(depth.at(stamp)->encoding, "16UC1");
  EXPECT_EQ(metres.at(stamp)->encoding, "32FC1");
  EXPECT_EQ(depth.at(stamp)->header.frame_id, "camera_rgb_optical_frame");
  EXPECT_NEAR(depth_info.at(stamp)->K[0], 525, 1e-3);
  const auto& image = *color.all().rbegin()->second;
  EXPECT_EQ(image.encoding, "rgb8");
  EXPECT_EQ(image.header.frame_id, "camera_rgb_optical_frame");
  EXPECT_LT(std::abs((image.header.stamp - ros::Time::now()).toSec()), 5);

  const Cloud points = cloudFromMessage(*cloud), truth = scene::threeObjects().cloud;
  ASSERT_EQ(points.width, 640);
  ASSERT_EQ(points.height, 480);
  EXPECT_EQ(points.rgb, truth.rgb);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    ASSERT_EQ(points.valid(i), truth.valid(i));
    if (truth.valid(i)) {
      ASSERT_LT((points.point(i) - truth.point(i)).norm(), 0.001);
    }
  }
}

TEST_F(Openni2, objectsHaveTheirPosesLiveAndTheSameFromARecording) {
  const auto live = namedFrame("/perception/refine/objects");
  ASSERT_TRUE(live);
  EXPECT_EQ(live->header.frame_id, "camera_rgb_optical_frame");
  EXPECT_EQ(live->objects.size(), 3u);
  expectTruth(*live);

  record(recording());  // for which the replaying camera waits
  const auto replayed = namedFrame("/replayed/refine/objects");
  ASSERT_TRUE(replayed);
  EXPECT_EQ(replayed->objects.size(), 3u);
  for (const auto& object : live->objects) {
    SCOPED_TRACE(object.name);
    const auto a = poseFromMessage(object.pose);
    const auto b = poseFromMessage(find(*replayed, object.name).pose);
    EXPECT_LT((a.translation() - b.translation()).norm(), 0.001);
    EXPECT_LT(angleOf(a.linear().transpose() * b.linear()), 0.5 * M_PI / 180);
  }
}

TEST_F(Openni2, comesBackWhenItIsPluggedInAgain) {
  Recorder<sensor_msgs::PointCloud2> clouds(nh_, "/camera/depth_registered/points");
  ASSERT_TRUE(spinUntil([&] { return clouds.all().size() > 3 && log_.connected(); }, 20));
  std::ofstream(unplugged()) << '\n';
  EXPECT_TRUE(spinUntil([&] { return log_.has("synthetic://0 (serial S1701) is gone"); }, 10));
  EXPECT_TRUE(says("no frame answered: no OpenNI2 camera is connected"));
  spinUntil([] { return false; }, 0.5);  // what is still on its way
  const auto before = clouds.all().size();
  spinUntil([] { return false; }, 2);
  EXPECT_EQ(clouds.all().size(), before);

  std::filesystem::remove(unplugged());
  EXPECT_TRUE(spinUntil([&] { return clouds.all().size() > before + 3; }, 10));
  EXPECT_TRUE(says("frames per second"));
  const auto frame = namedFrame("/perception/refine/objects");
  ASSERT_TRUE(frame);
  expectTruth(*frame);
}

TEST_F(Openni2, comesBackWhenItIsUnloaded) {
  Recorder<sensor_msgs::PointCloud2> clouds(nh_, "/camera/depth_registered/points");
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(spinUntil([&, before = clouds.all().size()] {  //
      return clouds.all().size() > before + 3;
    })) << "unloaded "
        << i << " times";
    nodelet::NodeletUnload unload;
    unload.request.name = "/camera";  // the keeper loads it again
    ASSERT_TRUE(ros::service::call("/perception/manager/unload_nodelet", unload));
    ASSERT_TRUE(unload.response.success);
    spinUntil([] { return false; }, 0.2);  // what is still on its way
  }
  EXPECT_TRUE(spinUntil([&, before = clouds.all().size()] {  //
    return clouds.all().size() > before + 3;
  })) << "the manager died with it?";
}

TEST_F(Openni2, opticalFramesLookForward) {
  tf2_ros::Buffer tf;
  tf2_ros::TransformListener listener(tf);
  for (const std::string frame : {"camera_rgb_optical_frame", "camera_depth_optical_frame"}) {
    ASSERT_TRUE(spinUntil([&] { return tf.canTransform("camera_link", frame, ros::Time(0)); }));
    const auto T = tf.lookupTransform("camera_link", frame, ros::Time(0)).transform.rotation;
    const Eigen::Quaterniond rotation(T.w, T.x, T.y, T.z);
    EXPECT_TRUE((rotation * Eigen::Vector3d::UnitZ()).isApprox(Eigen::Vector3d::UnitX(), 1e-6));
    EXPECT_TRUE((rotation * Eigen::Vector3d::UnitY()).isApprox(-Eigen::Vector3d::UnitZ(), 1e-6));
  }
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "openni2_test");
  return RUN_ALL_TESTS();
}
