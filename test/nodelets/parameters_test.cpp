#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <nodelet/NodeletList.h>
#include <nodelet/NodeletLoad.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

/// Loads nodelets with wrong parameters into a running manager.
class Parameters : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(ros::service::waitForService("/manager/load_nodelet", 10000));
    ASSERT_TRUE(spinUntil([&] { return log_.connected(); }));
  }

  void load(const std::string& name, const std::string& type) {
    nodelet::NodeletLoad call;
    call.request.name = name;
    call.request.type = "tabletop_perception/" + type;
    ASSERT_TRUE(ros::service::call("/manager/load_nodelet", call));
  }

  /// Whether the error names all of `parts`, and the nodelet offers nothing.
  void expectRefused(const std::string& name, const std::vector<std::string>& parts) {
    EXPECT_TRUE(spinUntil([&] { return log_.has(name + " is not started"); }, 5));
    for (const auto& part : parts) EXPECT_TRUE(log_.has(part)) << part;
    EXPECT_FALSE(ros::service::exists(name + "/set_parameters", false));
    nodelet::NodeletList list;
    EXPECT_TRUE(ros::service::call("/manager/list", list)) << "the manager lives on";
  }

  ros::NodeHandle nh_;
  LogRecorder log_{nh_};
};

TEST_F(Parameters, anUnknownKeyIsNamed) {
  nh_.setParam("/typo/tolerence", 0.02);
  load("/typo", "cluster");
  expectRefused("/typo", {"/typo/tolerence", "tolerance"});
}

TEST_F(Parameters, aValueOutOfRangeIsNamedWithTheRange) {
  nh_.setParam("/negative/min_range", -1.0);
  load("/negative", "filter");
  expectRefused("/negative", {"/negative/min_range must be between 0 and 100, got -1"});
}

TEST_F(Parameters, aWrongTypeIsNamed) {
  nh_.setParam("/worded/min_points", "many");
  load("/worded", "table");
  expectRefused("/worded", {"/worded/min_points", "many"});
}

TEST_F(Parameters, aWrongWordIsNamedWithTheRightOnes) {
  nh_.setParam("/metric/metric", "manhattan");
  load("/metric", "match");
  expectRefused("/metric", {"/metric/metric", "manhattan", "chi_square"});
}

TEST_F(Parameters, anOptionOfVerifyIsChecked) {
  nh_.setParam("/verify/min_score", 2.0);
  load("/refine", "refine");
  nh_.deleteParam("/verify/min_score");
  expectRefused("/refine", {"/verify/min_score must be between 0 and 1, got 2"});
}

TEST_F(Parameters, anOptionOfMatchIsCheckedByRefineToo) {
  nh_.setParam("/match/neighbors", 0);
  load("/leftovers/refine", "refine");
  EXPECT_TRUE(ros::service::waitForService("/leftovers/refine/set_parameters", 5000))
      << "/match is not beside it";
  load("/refine_of_match", "refine");
  nh_.deleteParam("/match/neighbors");
  expectRefused("/refine_of_match", {"match.neighbors must be between 1 and", "got 0"});
}

TEST_F(Parameters, rightOnesStartAndAWholeNumberIsANumber) {
  nh_.setParam("/right/max_range", 3);
  nh_.setParam("/right/crop_axis", "z");
  load("/right", "filter");
  EXPECT_TRUE(ros::service::waitForService("/right/set_parameters", 5000));
  double range = 0;
  EXPECT_TRUE(nh_.getParam("/right/max_range", range));
  EXPECT_EQ(range, 3);
}

TEST_F(Parameters, contradictionsAreRefusedAtTheStart) {
  nh_.setParam("/crossed/min_range", 3.0);
  load("/crossed", "filter");
  expectRefused("/crossed", {"/crossed/min_range must be below /crossed/max_range, got 3 and 2"});
  nh_.setParam("/twice/pitch", 30);
  nh_.setParam("/twice/up", std::vector<double>{0, -1, 0});
  load("/twice", "table");
  expectRefused("/twice", {"up is given twice"});
}

TEST_F(Parameters, aLiveChangeThatContradictsChangesNothing) {
  load("/live", "filter");
  ASSERT_TRUE(ros::service::waitForService("/live/set_parameters", 5000));
  const auto changed = [](double min_range) {
    dynamic_reconfigure::Reconfigure call;
    dynamic_reconfigure::DoubleParameter parameter;
    parameter.name = "min_range";
    parameter.value = min_range;
    call.request.config.doubles.push_back(parameter);
    EXPECT_TRUE(ros::service::call("/live/set_parameters", call));
    for (const auto& value : call.response.config.doubles)
      if (value.name == "min_range") return value.value;
    return -1.0;
  };
  EXPECT_EQ(changed(0.5), 0.5);
  EXPECT_EQ(changed(5), 0.5);  // above max_range
  EXPECT_EQ(changed(0.4), 0.4);
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "parameters_test");
  return RUN_ALL_TESTS();
}
