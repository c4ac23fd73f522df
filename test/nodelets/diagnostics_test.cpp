#include <gtest/gtest.h>

#include <algorithm>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PointStamped.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;
using diagnostic_msgs::DiagnosticStatus;

/// The last status of each stage, and those of one stage that came since the last clear().
class Diagnostics {
 public:
  explicit Diagnostics(ros::NodeHandle& nh)
      : subscriber_(nh.subscribe<diagnostic_msgs::DiagnosticArray>(
            "/diagnostics", 100, [this](const auto& message) {
              for (const auto& status : message->status) statuses_.push_back(status);
            })) {}

  void clear() { statuses_.clear(); }

  /// Whether a stage has said what the condition asks for.
  template <typename Condition>
  bool said(const std::string& stage, Condition condition) const {
    return std::any_of(statuses_.begin(), statuses_.end(), [&](const DiagnosticStatus& status) {
      return status.name.find("perception/" + stage) != std::string::npos && condition(status);
    });
  }

 private:
  std::vector<DiagnosticStatus> statuses_;
  ros::Subscriber subscriber_;
};

std::string valueOf(const DiagnosticStatus& status, const std::string& key) {
  for (const auto& value : status.values)
    if (value.key == key) return value.value;
  return "";
}

class DiagnosticsOfTheGraph : public testing::Test {
 protected:
  ros::NodeHandle nh_;
  Camera camera_{nh_};
  Diagnostics diagnostics_{nh_};

  /// Sends frames until a stage says what the condition asks for; false if it does not.
  template <typename Frame, typename Condition>
  bool saysOn(const Frame& frame, const std::string& stage, Condition condition) {
    return spinUntil([&] {
      camera_.send(frame);
      return spinUntil([&] { return diagnostics_.said(stage, condition); }, 0.3);
    });
  }
};

TEST_F(DiagnosticsOfTheGraph, rateAndLatencyOfEveryStageAreTold) {
  Recorder<sensor_msgs::PointCloud2> models(nh_, "/perception/markers/models");
  const Cloud cloud = scene::threeObjects().cloud;
  for (const std::string stage : {"filter", "table", "cluster", "match", "refine"})
    EXPECT_TRUE(saysOn(cloud, stage, [](const DiagnosticStatus& status) {
      const std::string rate = valueOf(status, "frames per second");
      const std::string latency = valueOf(status, "latency, mean [ms]");
      return !rate.empty() && std::stod(rate) > 0 && !latency.empty() && std::stod(latency) > 0 &&
             std::stod(latency) < 60000;
    })) << stage;
}

TEST_F(DiagnosticsOfTheGraph, aFrameThatCannotBeReadIsCountedWithItsCause) {
  auto message = *messageFromCloud(scene::threeObjects().cloud, std_msgs::Header());
  message.fields[0].name = "intensity";
  EXPECT_TRUE(saysOn(message, "filter", [](const DiagnosticStatus& status) {
    const std::string cause = "cloud has no field 'x', its fields are: intensity y z rgb";
    return status.level == DiagnosticStatus::WARN &&
           status.message == "no frame answered: " + cause &&
           !valueOf(status, "dropped: " + cause).empty();
  }));
}

TEST_F(DiagnosticsOfTheGraph, theReasonOfTheLastFrameIsTold) {
  EXPECT_TRUE(saysOn(Cloud(640, 480, true), "table", [](const DiagnosticStatus& status) {
    return status.message == "the cloud has no valid point" &&
           valueOf(status, "last reason") == status.message;
  }));
}

TEST_F(DiagnosticsOfTheGraph, whatAPickDidIsTold) {
  auto clicks = nh_.advertise<geometry_msgs::PointStamped>("/clicked_point", 1);
  ASSERT_TRUE(spinUntil([&] { return clicks.getNumSubscribers() > 0; }));
  geometry_msgs::PointStamped in_the_air;
  in_the_air.header.frame_id = "camera";
  in_the_air.point.z = 0.2;
  const Cloud cloud = scene::threeObjects().cloud;
  EXPECT_TRUE(spinUntil([&] {
    clicks.publish(in_the_air);
    camera_.send(cloud);
    return spinUntil(
        [&] {
          return diagnostics_.said("pick", [](const DiagnosticStatus& status) {
            const std::string rate = valueOf(status, "frames per second");
            return !rate.empty() && std::stod(rate) > 0 &&
                   valueOf(status, "last reason").find("the air") != std::string::npos;
          });
        },
        0.3);
  }));
}

TEST_F(DiagnosticsOfTheGraph, silenceOfTheCameraIsAWarning) {
  ASSERT_TRUE(spinUntil([&] { return camera_.connected(); }));
  spinUntil([] { return false; }, 3);  // what was sent before is through
  diagnostics_.clear();
  EXPECT_TRUE(spinUntil([&] {
    return diagnostics_.said("filter", [](const DiagnosticStatus& status) {
      return status.level == DiagnosticStatus::WARN && status.message == "no frame came";
    });
  }));
}

TEST_F(DiagnosticsOfTheGraph, whatNobodyListensToSleeps) {
  EXPECT_TRUE(spinUntil([&] {
    return diagnostics_.said("markers", [](const DiagnosticStatus& status) {
      return status.level == DiagnosticStatus::OK && status.message == "asleep: nobody listens";
    });
  }));
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "diagnostics_test");
  return RUN_ALL_TESTS();
}
