#include <gtest/gtest.h>

#include <diagnostic_msgs/DiagnosticArray.h>

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

  /// Waits until a stage says what the condition asks for.
  template <typename Condition>
  bool says(const std::string& stage, Condition condition) {
    return spinUntil([&] {
      return std::any_of(statuses_.begin(), statuses_.end(), [&](const DiagnosticStatus& status) {
        return status.name.find("/perception/" + stage) != std::string::npos && condition(status);
      });
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

  void sendUntil(const std::function<bool()>& told) {
    const Cloud cloud = scene::threeObjects().cloud;
    spinUntil([&] {
      camera_.send(cloud);
      return spinUntil(told, 0.3);
    });
  }
};

TEST_F(DiagnosticsOfTheGraph, rateAndLatencyOfEveryStageAreTold) {
  Recorder<visualization_msgs::MarkerArray> markers(nh_, "/perception/markers/markers");
  for (const std::string stage : {"filter", "table", "cluster", "match", "refine"}) {
    bool told = false;
    sendUntil([&] {
      return told = diagnostics_.says(stage, [](const DiagnosticStatus& status) {
        const std::string rate = valueOf(status, "frames per second");
        const std::string latency = valueOf(status, "latency, mean [ms]");
        return !rate.empty() && std::stod(rate) > 0 && !latency.empty() && std::stod(latency) > 0 &&
               std::stod(latency) < 60000;
      });
    });
    EXPECT_TRUE(told) << stage;
  }
}

TEST_F(DiagnosticsOfTheGraph, aFrameThatCannotBeReadIsCountedWithItsCause) {
  auto message = *messageFromCloud(scene::threeObjects().cloud, std_msgs::Header());
  message.fields[0].name = "intensity";
  bool told = false;
  spinUntil([&] {
    camera_.send(message);
    return told = diagnostics_.says("filter", [](const DiagnosticStatus& status) {
      return status.level == DiagnosticStatus::WARN &&
             status.message.find("no field 'x'") != std::string::npos &&
             !valueOf(status, "dropped: cloud has no field 'x', its fields are: intensity y z rgb")
                  .empty();
    });
  });
  EXPECT_TRUE(told);
}

TEST_F(DiagnosticsOfTheGraph, theReasonOfTheLastFrameIsTold) {
  bool told = false;
  spinUntil([&] {
    camera_.send(Cloud(640, 480, true));
    return told = diagnostics_.says("table", [](const DiagnosticStatus& status) {
      return status.message == "the cloud has no valid point" &&
             valueOf(status, "last reason") == status.message;
    });
  });
  EXPECT_TRUE(told);
}

TEST_F(DiagnosticsOfTheGraph, silenceOfTheCameraIsAWarning) {
  ASSERT_TRUE(spinUntil([&] { return camera_.connected(); }));
  spinUntil([] { return false; }, 3);  // what was sent before is through
  diagnostics_.clear();
  EXPECT_TRUE(diagnostics_.says("filter", [](const DiagnosticStatus& status) {
    return status.level == DiagnosticStatus::WARN && status.message == "no frame came";
  }));
}

TEST_F(DiagnosticsOfTheGraph, whatNobodyListensToSleeps) {
  EXPECT_TRUE(diagnostics_.says("markers", [](const DiagnosticStatus& status) {
    return status.level == DiagnosticStatus::OK && status.message == "asleep: nobody listens";
  }));
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "diagnostics_test");
  return RUN_ALL_TESTS();
}
