#include "diagnose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "finding_ids.h"

namespace tabletop_perception::tools {
namespace {

constexpr int CLOUDS = 50;
constexpr double RATE = 10;  // [Hz]

/// A camera at 10 Hz, 60 ms late, in a graph that does its work.
Observed healthyGraph() {
  Observed seen;
  seen.source = "http://localhost:11311";
  seen.seconds = CLOUDS / RATE;
  seen.input = "/camera/points";
  seen.topics["/camera/points"] = {"sensor_msgs/PointCloud2", {"/camera/driver"}};
  seen.topics["/camera/camera_info"] = {"sensor_msgs/CameraInfo", {"/camera/driver"}};
  seen.camera_info = "/camera/camera_info";
  seen.camera_infos = CLOUDS;
  for (int i = 0; i < CLOUDS; ++i) {
    CloudSeen cloud;
    cloud.stamp = 1.7e9 + i / RATE;
    cloud.arrival = cloud.stamp + 0.06;
    cloud.seq = 100 + i;
    cloud.frame_id = "camera_depth_optical_frame";
    cloud.width = 640;
    cloud.height = 480;
    cloud.bytes = 640 * 480 * 16;
    seen.clouds.push_back(cloud);
  }
  PointsSeen points;
  points.fields = {"x", "y", "z", "rgb"};
  points.pixels = 640 * 480;
  for (int i = 0; i < 1000; ++i) points.ranges.push_back(0.7f + 0.001f * i);
  points.direction = {0.02, -0.05, 0.92};
  seen.points = {points};
  seen.transforms["camera_link"] = {"base_link", false, 0.01, 0.02};
  seen.transforms["camera_depth_optical_frame"] = {"camera_link", true, 1e5, 5};
  seen.tables = TablesSeen{CLOUDS, CLOUDS, ""};

  seen.graph.emplace();
  seen.graph->ns = "/perception";
  for (const auto* topic :
       {"filter/cloud", "table/tables", "cluster/clusters", "match/candidates", "refine/objects"})
    seen.graph->stages.emplace_back(std::string("/perception/") + topic, true);
  seen.graph->up_frame = "base_link";
  seen.graph->database = DatabaseSeen{"/data/objects.db", true, "", 3};
  seen.graph->candidates = CLOUDS;
  seen.graph->objects = CLOUDS;
  return seen;
}

/// A fault as it shows, the one finding that must come of it, and words that its text must hold:
/// the name, the value and what would be right.
struct Fault {
  std::string id;
  std::vector<std::string> words;
  std::function<void(Observed&)> inject;
};
std::ostream& operator<<(std::ostream& out, const Fault& fault) { return out << fault.id; }

template <typename Change>
void eachCloud(Observed& seen, const Change& change) {
  for (auto& cloud : seen.clouds) change(cloud);
}

/// The graph when nothing comes from the camera.
void stopCamera(Observed& seen) {
  seen.clouds.clear();
  seen.points.clear();
  seen.camera_infos = 0;
  seen.tables = TablesSeen();
  seen.graph->candidates = seen.graph->objects = 0;
}

/// The filter listens to another topic.
void misdirect(Observed& seen, const std::string& topic) {
  stopCamera(seen);
  seen.input = topic;
}

void noTable(Observed& seen, const std::string& reason) {
  seen.tables = TablesSeen{CLOUDS, 0, reason};
}

void scaleRanges(Observed& seen, float factor) {
  for (auto& range : seen.points[0].ranges) range *= factor;
  noTable(seen, "the cloud has no valid point");
}

/// Every third cloud comes.
void loseClouds(Observed& seen) {
  std::vector<CloudSeen> came;
  for (std::size_t i = 0; i < seen.clouds.size(); i += 3) came.push_back(seen.clouds[i]);
  seen.clouds = came;
}

const std::vector<Fault> FAULTS{
    {"no_master",
     {"http://localhost:11311", "ROS_MASTER_URI"},
     [](Observed& seen) { seen.reachable = false; }},
    {"no_cloud_topic",
     {"/camera/points", "driver"},
     [](Observed& seen) {
       stopCamera(seen);
       seen.topics.clear();
     }},
    {"no_cloud_topic",
     {"/camera/points", "/camera/depth/image", "perception.launch depth:="},
     [](Observed& seen) {
       stopCamera(seen);
       seen.topics = {{"/camera/depth/image", {"sensor_msgs/Image", {"/camera/driver"}}}};
     }},
    {"wrong_topic",
     {"/kinect/points", "input:=", "/camera/points"},
     [](Observed& seen) { misdirect(seen, "/kinect/points"); }},
    {"wrong_type",
     {"/camera/image", "sensor_msgs/Image", "sensor_msgs/PointCloud2", "/camera/points"},
     [](Observed& seen) {
       misdirect(seen, "/camera/image");
       seen.topics["/camera/image"] = {"sensor_msgs/Image", {"/camera/driver"}};
     }},
    {"camera_silent", {"/camera/points", "5 s"}, stopCamera},
    {"several_cameras",
     {"/camera/points", "/camera/driver", "/other", "must be one"},
     [](Observed& seen) { seen.topics["/camera/points"].publishers.push_back("/other"); }},
    {"sim_time_without_clock",
     {"use_sim_time is true", "/clock", "--clock"},
     [](Observed& seen) {
       seen.graph->use_sim_time = true;
       eachCloud(seen, [](CloudSeen& cloud) { cloud.arrival.reset(); });
     }},
    {"clock_without_sim_time",
     {"/clock", "use_sim_time", "1e+08 s"},
     [](Observed& seen) {
       seen.clock = true;
       eachCloud(seen, [](CloudSeen& cloud) { *cloud.arrival += 1e8; });
       *seen.transforms["camera_link"].lag += 1e8;
     }},
    {"frame_empty",
     {"header.frame_id", "/camera/points", "must name"},
     [](Observed& seen) {
       eachCloud(seen, [](CloudSeen& cloud) { cloud.frame_id.clear(); });
       noTable(seen, "no up direction: Invalid argument passed to lookupTransform");
     }},
    {"frame_slash",
     {"'/camera_depth_optical_frame'", "must be 'camera_depth_optical_frame'"},
     [](Observed& seen) {
       eachCloud(seen, [](CloudSeen& cloud) { cloud.frame_id = "/" + cloud.frame_id; });
       noTable(seen, "no up direction: tf2 frame_ids cannot start with a '/'");
     }},
    {"frame_changes",
     {"/camera/points", "'camera_link'", "'camera_depth_optical_frame'", "must be one"},
     [](Observed& seen) { seen.clouds[3].frame_id = "camera_link"; }},
    {"stamp_zero",
     {"50 of 50", "/camera/points", "stamp 0"},
     [](Observed& seen) { eachCloud(seen, [](CloudSeen& cloud) { cloud.stamp = 0; }); }},
    {"stamp_future",
     {"/camera/points", "3 s ahead", "limit 0.1"},
     [](Observed& seen) {
       eachCloud(seen, [](CloudSeen& cloud) { cloud.arrival = cloud.stamp - 3; });
     }},
    {"stamp_old",
     {"/camera/points", "2 s old", "limit 0.5"},
     [](Observed& seen) {
       eachCloud(seen, [](CloudSeen& cloud) { cloud.arrival = cloud.stamp + 2; });
     }},
    {"stamp_not_increasing",
     {"/camera/points", "1700000001.200000"},
     [](Observed& seen) { seen.clouds[13].stamp = seen.clouds[12].stamp; }},
    {"network_slow",
     {"32 of 49", "/camera/points", "16.7 MB/s", "48.2 MB/s are needed"},
     loseClouds},
    {"network_slow",
     {"never came"},  // of a publisher that does not count
     [](Observed& seen) {
       for (const int i : {40, 39, 33, 27, 26, 25, 12, 11})
         seen.clouds.erase(seen.clouds.begin() + i);
       eachCloud(seen, [](CloudSeen& cloud) { cloud.seq = 0; });
     }},
    {"rate_low",
     {"3.4 Hz", "/camera/points", "10 Hz", "/camera/camera_info"},
     [](Observed& seen) {
       loseClouds(seen);
       for (std::size_t i = 0; i < seen.clouds.size(); ++i) seen.clouds[i].seq = i;
     }},
    {"cloud_fields",
     {"/camera/points", "lack the fields y, z", "[x, intensity]"},
     [](Observed& seen) {
       seen.points[0] = PointsSeen();
       seen.points[0].fields = {"x", "intensity"};
       seen.points[0].unreadable = "no field y";
       seen.tables = TablesSeen();
     }},
    {"cloud_unreadable",
     {"/camera/points", "row_step must be 10240, got 17"},
     [](Observed& seen) {
       seen.points[0].unreadable = "row_step must be 10240, got 17";
       seen.tables = TablesSeen();
     }},
    {"cloud_empty",
     {"/camera/points", "0 x 0"},
     [](Observed& seen) {
       seen.points[0].pixels = 0;
       seen.points[0].ranges.clear();
       eachCloud(seen, [](CloudSeen& cloud) { cloud.width = cloud.height = 0; });
       noTable(seen, "the cloud has no valid point");
     }},
    {"cloud_all_nan",
     {"all 307200", "/camera/points", "NaN"},
     [](Observed& seen) {
       seen.points[0].ranges.clear();
       noTable(seen, "the cloud has no valid point");
     }},
    {"cloud_unorganized",
     {"/camera/points", "307200 x 1", "width x height"},
     [](Observed& seen) {
       eachCloud(seen, [](CloudSeen& cloud) { cloud.width *= cloud.height, cloud.height = 1; });
     }},
    {"optical_mixup",
     {"look along x", "camera_depth_optical_frame", "z forward"},
     [](Observed& seen) {
       seen.points[0].direction = {0.92, 0.02, -0.05};
     }},
    {"optical_mixup",
     {"look along z", "camera_link", "x forward"},
     [](Observed& seen) {
       eachCloud(seen, [](CloudSeen& cloud) { cloud.frame_id = "camera_link"; });
     }},
    {"depth_millimetres",
     {"/camera/points", "1.2e+03 m", "1.2 m in millimetres"},
     [](Observed& seen) { scaleRanges(seen, 1000); }},
    {"depth_too_small",
     {"/camera/points", "0.0012 m", "metres"},
     [](Observed& seen) { scaleRanges(seen, 0.001f); }},
    {"table_behind_crop",
     {"100 %", "filter.max_range of 2 m", "2.51 m"},
     [](Observed& seen) {
       for (auto& range : seen.points[0].ranges) range += 1.31f;
       noTable(seen, "largest plane has 12 points, limit 2000");
     }},
    {"table_before_crop",
     {"filter.min_range of 0.8 m", "0.4 m"},
     [](Observed& seen) {
       seen.filter.min_range = 0.8;
       for (auto& range : seen.points[0].ranges) range /= 3;
       noTable(seen, "the cloud has no valid point");
     }},
    {"tf_missing",
     {"/tf", "up_frame is base_link", "camera_depth_optical_frame"},
     [](Observed& seen) {
       seen.transforms.clear();
       noTable(seen, "no up direction: \"base_link\" does not exist");
     }},
    {"frame_unknown",
     {"camera_depth_optical_frame", "base_link", "static_transform_publisher"},
     [](Observed& seen) {
       seen.transforms.erase("camera_depth_optical_frame");
       noTable(seen, "no up direction: \"camera_depth_optical_frame\" does not exist");
     }},
    {"up_frame_unknown",
     {"world", "base_link", "up_frame"},
     [](Observed& seen) {
       seen.graph->up_frame = "world";
       noTable(seen, "no up direction: \"world\" does not exist");
     }},
    {"tf_disconnected",
     {"camera_depth_optical_frame", "base_link", "camera_link", "missing"},
     [](Observed& seen) {
       seen.transforms.erase("camera_link");
       seen.transforms["arm"] = {"base_link", true, 1e5, 5};
       noTable(seen, "no up direction: two unconnected trees");
     }},
    {"tf_past",
     {"base_link -> camera_link", "2.94 s behind", "limit 0.2"},
     [](Observed& seen) {
       seen.transforms["camera_link"].lag = 3;
       noTable(seen, "no up direction: extrapolation into the future");
     }},
    {"tf_future",
     {"base_link -> camera_link", "30.1 s ahead", "limit 2"},
     [](Observed& seen) {
       seen.transforms["camera_link"].lag = -30;
       noTable(seen, "no up direction: extrapolation into the past");
     }},
    {"graph_missing",
     {"/perception", "perception.launch", "--namespace /robot"},
     [](Observed& seen) {
       misdirect(seen, "");
       for (auto& [topic, advertised] : seen.graph->stages) advertised = false;
       seen.graph->other_ns = {"/robot"};
     }},
    {"input_unknown", {"/perception", "--topic"}, [](Observed& seen) { misdirect(seen, ""); }},
    {"stage_missing",
     {"/perception/match/candidates", "refused their parameters"},
     [](Observed& seen) {
       seen.graph->stages[3].second = false;
       seen.graph->candidates = seen.graph->objects = 0;
     }},
    {"node_unreachable",
     {"/perception/manager", "rosnode cleanup", "ROS_IP"},
     [](Observed& seen) {
       seen.graph->silent_nodes = {"/perception/manager"};
       seen.tables = TablesSeen();
       seen.graph->candidates = seen.graph->objects = 0;
     }},
    {"stage_silent",
     {"/perception/table/tables", "50 frames", "filter or table"},
     [](Observed& seen) {
       seen.tables = TablesSeen();
       seen.graph->candidates = seen.graph->objects = 0;
     }},
    {"stage_silent",
     {"/perception/match/candidates", "cluster or match"},
     [](Observed& seen) { seen.graph->candidates = seen.graph->objects = 0; }},
    {"stage_silent",
     {"/perception/refine/objects", "refine hangs"},
     [](Observed& seen) { seen.graph->objects = 0; }},
    {"answers_slow",
     {"2 of 50", "tuning"},
     [](Observed& seen) { seen.graph->candidates = seen.graph->objects = 2; }},
    {"up_unknown",
     {"/perception/table", "up_frame", "pitch"},
     [](Observed& seen) { seen.graph->up_frame.clear(); }},
    {"database_missing",
     {"/data/objects.db", "does not exist", "tabletop train"},
     [](Observed& seen) {
       seen.graph->database = DatabaseSeen{"/data/objects.db", false, "", 0};
       seen.graph->candidates_reason = "database /data/objects.db: No such file or directory";
     }},
    {"database_unreadable",
     {"/data/objects.db", "cut short"},
     [](Observed& seen) {
       seen.graph->database =
           DatabaseSeen{"/data/objects.db", true, "/data/objects.db: is damaged or cut short", 0};
     }},
    {"database_version",
     {"/data/objects.db", "schema version 1", "reads 2"},
     [](Observed& seen) {
       seen.graph->database =
           DatabaseSeen{"/data/objects.db", true,
                        "/data/objects.db: has schema version 1, this program reads 2", 0};
     }},
    {"database_empty",
     {"/data/objects.db", "0 objects", "tabletop train"},
     [](Observed& seen) { seen.graph->database->objects = 0; }},
    {"no_table",
     {"largest plane is 61 deg from up, limit 20"},
     [](Observed& seen) { noTable(seen, "largest plane is 61 deg from up, limit 20"); }},
    {"nothing_on_table",
     {"table.min_height"},
     [](Observed& seen) { seen.tables->reason = "nothing stands on it"; }},
};

class AFault : public testing::TestWithParam<Fault> {};

TEST_P(AFault, IsNamedRightAndAloneInOneLineWithItsFigures) {
  Observed seen = healthyGraph();
  GetParam().inject(seen);
  const auto findings = diagnose(seen);
  ASSERT_EQ(idsOf(findings), GetParam().id);
  const auto& text = findings[0].text;
  for (const auto& word : GetParam().words) EXPECT_NE(text.find(word), text.npos) << text;
  EXPECT_EQ(text.find('\n'), text.npos) << text;
}

INSTANTIATE_TEST_SUITE_P(Diagnose, AFault, testing::ValuesIn(FAULTS), [](const auto& info) {
  return info.param.id + "_" + std::to_string(info.index);
});

TEST(Diagnose, FindsNothingInAHealthyGraph) { EXPECT_EQ(idsOf(diagnose(healthyGraph())), ""); }

TEST(Diagnose, FindsNothingInAHealthyBag) {
  Observed seen = healthyGraph();
  seen.graph.reset();
  EXPECT_EQ(idsOf(diagnose(seen)), "");
}

TEST(Diagnose, TwoFaultsAreTwoFindings) {
  Observed seen = healthyGraph();
  seen.graph->database->objects = 0;
  eachCloud(seen, [](CloudSeen& cloud) { cloud.arrival = cloud.stamp + 2; });
  EXPECT_EQ(idsOf(diagnose(seen)), "stamp_old database_empty");
}

TEST(Diagnose, AWallFarBehindATableIsNoFault) {
  Observed seen = healthyGraph();
  for (std::size_t i = 300; i < seen.points[0].ranges.size(); ++i) seen.points[0].ranges[i] += 4;
  EXPECT_EQ(idsOf(diagnose(seen)), "");
}

TEST(Diagnose, ADatabaseOnAnotherMachineCountsAsThereWhenMatchReadIt) {
  Observed seen = healthyGraph();
  seen.graph->database->exists = false;
  EXPECT_EQ(idsOf(diagnose(seen)), "");
}

TEST(Diagnose, ACloudInTheRobotsFrameMayLookAnyWay) {
  Observed seen = healthyGraph();
  for (const auto* frame : {"base_link", "world_frame", "map"}) {
    seen.graph->up_frame = frame;
    eachCloud(seen, [&](CloudSeen& cloud) { cloud.frame_id = frame; });
    EXPECT_EQ(idsOf(diagnose(seen)), "") << frame;
  }
}

TEST(Diagnose, ALoopInTfDoesNotHangIt) {
  Observed seen = healthyGraph();
  seen.transforms["base_link"] = {"camera_depth_optical_frame", true, 1e5, 5};
  diagnose(seen);
}

TEST(Diagnose, OfNothingSeenAtAllSaysThatThereIsNoCloud) {
  EXPECT_EQ(idsOf(diagnose(Observed())), "no_cloud_topic");
}

}  // namespace
}  // namespace tabletop_perception::tools
