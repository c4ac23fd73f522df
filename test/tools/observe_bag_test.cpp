// Bags with real faults in them, through observeBag() and diagnose().
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "conversions.h"
#include "diagnose.h"
#include "finding_ids.h"
#include "observe.h"
#include "scene.h"
#include "temp_folder.h"

namespace tabletop_perception::tools {
namespace {

constexpr int FRAMES = 12;
constexpr double START = 1000;  // [s]
constexpr double RATE = 10;     // [Hz]

/// What is recorded; each fault changes some of it before it is written.
struct Recording {
  struct Entry {
    double time;
    sensor_msgs::PointCloud2 cloud;
  };
  std::vector<Entry> clouds;
  std::string topic = "/camera/points";
  std::string other_topic;  ///< with the same clouds; empty: none
  bool camera_info = true;
  bool image_only = false;
  bool tf_static = true;
  double tf_lag = 0.01;  ///< of base_link -> camera_link [s]; NaN: not recorded
};

Cloud smallScene() {
  scene::SceneOptions options;
  options.projection = {131, 131, 79.5, 59.5, 160, 120, 1};
  return scene::threeObjects(options).cloud;
}

Recording goodRecording() {
  static const sensor_msgs::PointCloud2 message = *messageFromCloud(smallScene(), {});
  Recording recording;
  for (int i = 0; i < FRAMES; ++i) {
    const double stamp = START + i / RATE;
    recording.clouds.push_back({stamp + 0.05, message});
    auto& header = recording.clouds.back().cloud.header;
    header.stamp = ros::Time(stamp);
    header.seq = i;
    header.frame_id = "camera_optical_frame";
  }
  return recording;
}

tf2_msgs::TFMessage transform(const std::string& parent, const std::string& child, double stamp) {
  tf2_msgs::TFMessage message;
  message.transforms.resize(1);
  message.transforms[0].header.stamp = ros::Time(stamp);
  message.transforms[0].header.frame_id = parent;
  message.transforms[0].child_frame_id = child;
  message.transforms[0].transform.rotation.w = 1;
  return message;
}

std::string writeBag(const TempFolder& folder, const Recording& recording) {
  const auto file = folder.file("drive.bag");
  rosbag::Bag bag(file, rosbag::bagmode::Write);
  for (int i = 0; i < FRAMES; ++i) {
    const ros::Time time(START + i / RATE);
    if (recording.camera_info) bag.write("/camera/camera_info", time, sensor_msgs::CameraInfo());
    if (!std::isnan(recording.tf_lag))
      bag.write("/tf", time,
                transform("base_link", "camera_link", time.toSec() - recording.tf_lag));
  }
  if (recording.tf_static)
    bag.write("/tf_static", ros::Time(START),
              transform("camera_link", "camera_optical_frame", START));
  for (const auto& [time, cloud] : recording.clouds) {
    if (recording.image_only) {
      bag.write("/camera/depth", ros::Time(time), sensor_msgs::Image());
      continue;
    }
    bag.write(recording.topic, ros::Time(time), cloud);
    if (!recording.other_topic.empty()) bag.write(recording.other_topic, ros::Time(time), cloud);
  }
  bag.close();
  return file;
}

struct BagFault {
  std::string id;
  std::function<void(Recording&)> inject;
  std::string topic = "";  ///< asked for
};
std::ostream& operator<<(std::ostream& out, const BagFault& fault) { return out << fault.id; }

template <typename Change>
void eachCloud(Recording& recording, const Change& change) {
  for (auto& entry : recording.clouds) change(entry.cloud);
}

void eachPoint(Recording& recording, const std::function<void(Eigen::Vector3f&)>& change) {
  eachCloud(recording, [&](sensor_msgs::PointCloud2& message) {
    Cloud cloud = cloudFromMessage(message);
    for (const int i : validIndices(cloud)) {
      Eigen::Vector3f point = cloud.point(i);
      change(point);
      cloud.setPoint(i, point);
    }
    message = *messageFromCloud(cloud, message.header);
  });
}

void shiftStamps(Recording& recording, double seconds) {
  eachCloud(recording, [&](auto& cloud) { cloud.header.stamp += ros::Duration(seconds); });
}

void setFrame(Recording& recording, const std::string& frame) {
  eachCloud(recording, [&](auto& cloud) { cloud.header.frame_id = frame; });
}

constexpr float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();

const std::vector<BagFault> BAG_FAULTS{
    {"no_cloud_topic", [](Recording& r) { r.image_only = true; }},
    {"wrong_topic", [](Recording&) {}, "/kinect/points"},
    {"wrong_type", [](Recording&) {}, "/camera/camera_info"},
    {"stamp_zero", [](Recording& r) { eachCloud(r, [](auto& c) { c.header.stamp = {}; }); }},
    {"stamp_future", [](Recording& r) { shiftStamps(r, 2); }},
    {"stamp_old", [](Recording& r) { shiftStamps(r, -2); }},
    {"stamp_not_increasing",
     [](Recording& r) { r.clouds[6].cloud.header.stamp = r.clouds[5].cloud.header.stamp; }},
    {"frame_empty", [](Recording& r) { setFrame(r, ""); }},
    {"frame_slash", [](Recording& r) { setFrame(r, "/camera_optical_frame"); }},
    {"frame_unknown", [](Recording& r) { r.tf_static = false; }},
    {"tf_past", [](Recording& r) { r.tf_lag = 3; }},
    {"tf_future", [](Recording& r) { r.tf_lag = -30; }},
    {"optical_mixup",
     [](Recording& r) { eachPoint(r, [](Eigen::Vector3f& p) {
                          p = {p.z(), -p.x(), -p.y()};
                        }); }},
    {"optical_mixup", [](Recording& r) { setFrame(r, "camera_link"); }},
    {"depth_millimetres",
     [](Recording& r) { eachPoint(r, [](Eigen::Vector3f& p) { p *= 1000; }); }},
    {"depth_too_small", [](Recording& r) { eachPoint(r, [](Eigen::Vector3f& p) { p /= 1000; }); }},
    {"table_behind_crop", [](Recording& r) { eachPoint(r, [](Eigen::Vector3f& p) { p *= 5; }); }},
    {"table_before_crop",
     [](Recording& r) { eachPoint(r, [](Eigen::Vector3f& p) { p *= 0.06f; }); }},
    {"cloud_all_nan",
     [](Recording& r) { eachPoint(r, [](Eigen::Vector3f& p) { p.setConstant(NOT_A_NUMBER); }); }},
    {"cloud_empty",
     [](Recording& r) {
       eachCloud(r, [](auto& c) { c = *messageFromCloud(Cloud(0, 0, false), c.header); });
     }},
    {"cloud_fields",
     [](Recording& r) { eachCloud(r, [](auto& c) { c.fields[2].name = "depth"; }); }},
    {"cloud_unreadable",
     [](Recording& r) { eachCloud(r, [](auto& c) { c.data.resize(c.data.size() / 2); }); }},
    {"cloud_unorganized",
     [](Recording& r) {
       eachCloud(r, [](auto& c) {
         c.width *= c.height;
         c.row_step *= c.height;
         c.height = 1;
       });
     }},
    {"network_slow",
     [](Recording& r) {
       for (const int i : {9, 8, 6, 3}) r.clouds.erase(r.clouds.begin() + i);
     }},
    {"rate_low",
     [](Recording& r) {
       for (const int i : {11, 10, 8, 7, 5, 4, 2, 1}) r.clouds.erase(r.clouds.begin() + i);
       r.clouds.push_back(r.clouds.back());
       r.clouds.back().cloud.header.stamp += ros::Duration(0.3);
       for (std::size_t i = 0; i < r.clouds.size(); ++i) r.clouds[i].cloud.header.seq = i;
     }},
    {"no_table",
     [](Recording& r) {
       int seed = 0;  // a thicket: points anywhere between 0.5 and 1.5 m
       eachPoint(r, [&](Eigen::Vector3f& p) {
         seed = (seed * 7621 + 1) % 32768;
         p *= (0.5f + seed / 32768.f) / p.norm();
       });
     }},
};

class ABagFault : public testing::TestWithParam<BagFault> {};

TEST_P(ABagFault, IsNamedRightAndAlone) {
  const TempFolder folder;
  auto recording = goodRecording();
  GetParam().inject(recording);
  const auto seen = observeBag(writeBag(folder, recording), GetParam().topic);
  const auto findings = diagnose(seen);
  EXPECT_EQ(idsOf(findings), GetParam().id) << (findings.empty() ? "" : findings.back().text);
}

INSTANTIATE_TEST_SUITE_P(Doctor, ABagFault, testing::ValuesIn(BAG_FAULTS), [](const auto& info) {
  return info.param.id + "_" + std::to_string(info.index);
});

TEST(ObserveBag, OfAGoodRecordingNothingIsWrong) {
  const TempFolder folder;
  const auto seen = observeBag(writeBag(folder, goodRecording()), "");
  EXPECT_EQ(idsOf(diagnose(seen)), "");
  EXPECT_EQ(seen.input, "/camera/points");
  EXPECT_EQ(seen.clouds.size(), FRAMES);
  EXPECT_EQ(seen.camera_info, "/camera/camera_info");
  ASSERT_TRUE(seen.tables);
  EXPECT_EQ(seen.tables->found, seen.tables->frames);
}

TEST(ObserveBag, OneCloudIsEnoughToLookAt) {
  const TempFolder folder;
  auto recording = goodRecording();
  recording.clouds.resize(1);
  const auto seen = observeBag(writeBag(folder, recording), "");
  EXPECT_EQ(seen.points.size(), 1u);
  EXPECT_EQ(idsOf(diagnose(seen)), "");
}

TEST(ObserveBag, AmongSeveralCamerasOneHasToBeChosen) {
  const TempFolder folder;
  auto recording = goodRecording();
  recording.other_topic = "/other/points";
  const auto file = writeBag(folder, recording);
  EXPECT_THROW(observeBag(file, ""), std::invalid_argument);
  EXPECT_EQ(idsOf(diagnose(observeBag(file, "/other/points"))), "");
}

TEST(ObserveBag, WhatIsNoBagIsRefused) {
  const TempFolder folder;
  EXPECT_THROW(observeBag(folder.file("no.bag"), ""), std::invalid_argument);
  EXPECT_THROW(observeBag(folder.write("text.bag", "hello\n"), ""), std::invalid_argument);
  const auto file = writeBag(folder, goodRecording());
  truncateFile(file, 0.6);
  EXPECT_THROW(observeBag(file, ""), std::invalid_argument);
}

}  // namespace
}  // namespace tabletop_perception::tools
