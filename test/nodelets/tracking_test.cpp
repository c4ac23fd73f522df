#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include <tf2_msgs/TFMessage.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

constexpr double PERIOD = 0.09;  // of the camera, by its stamps [s]
constexpr double CONFIRM = 0.2;  // track/confirm [s]
constexpr double GRACE = 0.5;    // track/grace [s]

/// A camera whose stamps are as far apart as it says, however long the graph takes.
class Tracking : public testing::Test {
 protected:
  Tracking() {
    const auto whole = scene::threeObjects();
    with_house_ = whole.cloud;
    without_house_ =
        scene::render({{"bracket", scene::painted(scene::bracket(), scene::BRACKET_COLOR),
                        scene::standing(0.02, 0.25, 2.5)},
                       {"steps", scene::painted(scene::steppedBlock(), scene::STEPS_COLOR),
                        scene::standing(0.0, -0.24, 2.4)}},
                      {})
            .cloud;
    trainObjects(whole.objects, databaseFile());
  }
  ~Tracking() override { std::filesystem::remove(databaseFile()); }

  /// The tf frames whose name begins with that of an object, sent with the stamp of the next cloud.
  std::set<std::string> framesOf(const std::string& object, const Cloud& cloud) {
    stamp_ += ros::Duration(PERIOD);
    const ros::Time stamp = camera_.send(cloud, stamp_);
    EXPECT_TRUE(spinUntil([&] { return objects_.has(stamp) && sent_.count(stamp) > 0; }));
    std::set<std::string> frames;
    for (const auto& frame : sent_[stamp])
      if (frame.rfind(object + "_", 0) == 0) frames.insert(frame);
    return frames;
  }

  ros::NodeHandle nh_;
  Camera camera_{nh_};
  Recorder<RecognizedObjectArray> objects_{nh_, "/perception/refine/objects"};
  /// Frames by stamp; the bracket and the steps have theirs in the one message that they come in.
  std::map<ros::Time, std::set<std::string>> sent_;
  ros::Subscriber tf_ = nh_.subscribe<tf2_msgs::TFMessage>("/tf", 100, [this](const auto& message) {
    for (const auto& transform : message->transforms)
      if (transform.child_frame_id != "table")
        sent_[transform.header.stamp].insert(transform.child_frame_id);
  });
  Cloud with_house_, without_house_;
  ros::Time stamp_;
  LogRecorder log_{nh_};
};

TEST_F(Tracking, framesComeAfterConfirmationStayThroughGapsAndGoAfterGrace) {
  ASSERT_TRUE(warmUp(without_house_, camera_, objects_));
  stamp_ = ros::Time::now();
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(framesOf("house", without_house_).empty());

  std::string frame;
  for (int i = 0; i < 6; ++i) {
    const auto frames = framesOf("house", with_house_);
    const bool due = i * PERIOD >= CONFIRM;
    ASSERT_EQ(frames.size(), due ? 1u : 0u) << "frame " << i << " that shows it";
    if (due && frame.empty()) frame = *frames.begin();
  }

  for (const int gap : {1, 2, 4}) {
    for (int i = 0; i < gap; ++i)
      EXPECT_EQ(framesOf("house", without_house_), std::set<std::string>{frame}) << "missed " << i;
    EXPECT_EQ(framesOf("house", with_house_), std::set<std::string>{frame}) << "the same id";
  }

  for (int i = 1; i <= 10; ++i) {
    const auto frames = framesOf("house", without_house_);
    EXPECT_EQ(frames.size(), i * PERIOD < GRACE ? 1u : 0u) << i << " frames after it was seen";
  }
  EXPECT_EQ(framesOf("bracket", without_house_).size(), 1u) << "what is there all the time stays";
}

TEST_F(Tracking, nothingStaysWhereTheCloudsComeInAnotherFrame) {
  ASSERT_TRUE(warmUp(with_house_, camera_, objects_));
  stamp_ = ros::Time::now();
  for (int i = 0; i < 5; ++i) framesOf("house", with_house_);
  const auto before = sent_[stamp_];
  ASSERT_EQ(before.size(), 3u);

  camera_.frame = "another_camera";
  sent_.clear();
  for (int i = 0; i < 6; ++i) {
    stamp_ += ros::Duration(PERIOD);
    camera_.send(without_house_, stamp_);
    ASSERT_TRUE(spinUntil([&] { return objects_.has(stamp_); }));
  }
  ASSERT_TRUE(spinUntil([&] { return sent_.count(stamp_) > 0; }));
  EXPECT_TRUE(log_.has("clouds come in the frame another_camera now, before in camera"));
  std::set<std::string> after;
  for (const auto& [stamp, frames] : sent_) after.insert(frames.begin(), frames.end());
  EXPECT_EQ(after.size(), 2u) << "bracket and steps, not the house where it was in the other frame";
  for (const auto& frame : before) EXPECT_EQ(after.count(frame), 0u) << frame << " a second time";
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "tracking_test");
  return RUN_ALL_TESTS();
}
