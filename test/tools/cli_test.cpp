// Runs the program itself: exit codes, clean standard output, one clear line for what is wrong.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "scene.h"
#include "tabletop_perception/database.h"
#include "tabletop_perception/pcd.h"
#include "tabletop_perception/train.h"
#include "temp_folder.h"

namespace tabletop_perception::tools {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct Outcome {
  int exit_code;
  std::string out, err;
};

std::string textOf(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// Runs `tabletop` with words that are quoted for the shell where they hold a space.
Outcome runTabletop(const std::string& arguments) {
  const TempFolder folder;
  const auto command = "'" TABLETOP_PROGRAM "' " + arguments + " >'" + folder.file("out") +
                       "' 2>'" + folder.file("err") + "' </dev/null";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, textOf(folder.file("out")),
          textOf(folder.file("err"))};
}

/// Exit code 2, nothing on standard output, and one line that holds `what`.
::testing::AssertionResult refuses(const std::string& arguments, const std::string& what) {
  const auto ran = runTabletop(arguments);
  const bool one_line = ran.err.find('\n') == ran.err.size() - 1;
  if (ran.exit_code == 2 && ran.out.empty() && one_line && ran.err.rfind("tabletop: ", 0) == 0 &&
      ran.err.find(what) != std::string::npos)
    return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure()
         << arguments << " -> " << ran.exit_code << "\nout: " << ran.out << "\nerr: " << ran.err
         << "\nlacks: " << what;
}

std::vector<json> linesOf(const std::string& text) {
  std::vector<json> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(json::parse(line));
  return lines;
}

/// Numbers that are not finite would be null: only `table`, reasons, what unknown things do not
/// have and colours that were not compared may be.
void expectNullOnlyForReasons(const json& value, const std::string& key) {
  const std::set<std::string> may_be = {"table", "reason",     "evidence",
                                        "color", "covariance", "free_directions"};
  EXPECT_TRUE(!value.is_null() || may_be.count(key)) << key << " is null";
  if (!value.is_structured()) return;
  for (const auto& item : value.items())
    expectNullOnlyForReasons(item.value(), value.is_object() ? item.key() : key);
}

Eigen::Vector3d vectorOf(const json& array) {
  return {array.at(0).get<double>(), array.at(1).get<double>(), array.at(2).get<double>()};
}

std::string upOf(const Eigen::Vector3d& up) {
  std::ostringstream text;
  text << " --up " << up.x() << " " << up.y() << " " << up.z() << " ";
  return text.str();
}

std::string save(const TempFolder& folder, const std::string& name, const Cloud& cloud) {
  PcdContents contents;
  contents.cloud = cloud;
  writePcd(folder.file(name), contents);
  return folder.file(name) + " ";
}

/// Share of the points of `truth` == `label` among those where either says so (IoU).
double overlap(const std::vector<std::uint32_t>& truth, std::uint32_t label,
               const std::vector<std::uint32_t>& found, std::uint32_t found_label) {
  double both = 0, either = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    both += truth[i] == label && found[i] == found_label;
    either += truth[i] == label || found[i] == found_label;
  }
  return either > 0 ? both / either : 0;
}

double bestOverlap(const std::vector<std::uint32_t>& truth, std::uint32_t label,
                   const std::vector<std::uint32_t>& found) {
  double best = 0;
  for (std::uint32_t found_label = 2; found_label < 10; ++found_label)
    best = std::max(best, overlap(truth, label, found, found_label));
  return best;
}

/// Three objects on a table, and an empty one, as files.
class TabletopProgram : public ::testing::Test {
 protected:
  void SetUp() override {
    three_ = scene::threeObjects();
    three_pcd_ = save(folder_, "three.pcd", three_.cloud);
  }

  TempFolder folder_;
  scene::SyntheticScene three_;
  std::string three_pcd_;
};

TEST_F(TabletopProgram, TellsItsVersionAndHelpOnStdout) {
  const auto version = runTabletop("--version");
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_EQ(version.out.rfind("tabletop ", 0), 0u);
  for (const auto* command : {"", "segment", "recognize", "pick", "benchmark"}) {
    const auto help = runTabletop(std::string(command) + " --help");
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_TRUE(help.err.empty()) << help.err;
    EXPECT_NE(help.out.find("Example: tabletop "), std::string::npos) << command;
    EXPECT_NE(help.out.find("etres"), std::string::npos) << command;
  }
}

TEST_F(TabletopProgram, RefusesBadUsage) {
  EXPECT_TRUE(refuses("", "subcommand is required"));
  EXPECT_TRUE(refuses("dance", "no subcommand dance"));
  EXPECT_TRUE(refuses("segment", "SCENE is required"));
  EXPECT_TRUE(refuses("segment --loud " + three_pcd_, "--loud"));
  EXPECT_TRUE(refuses("segment " + three_pcd_ + "--up 0 1", "--up"));
  EXPECT_TRUE(refuses("segment " + three_pcd_ + "--up a b c", "--up"));
  EXPECT_TRUE(refuses("segment " + three_pcd_ + "--up 0 0 0", "--up must be a direction"));
  EXPECT_TRUE(refuses("recognize " + three_pcd_, "--database is required"));
  EXPECT_TRUE(refuses("doctor missing.bag", "missing.bag: no such file"));
  EXPECT_TRUE(refuses("doctor missing.bag --seconds 3", "--seconds"));
  EXPECT_TRUE(refuses("doctor --seconds 0", "--seconds"));
}

TEST_F(TabletopProgram, RefusesBadScenes) {
  const auto segment = [&](const std::string& name) {
    return "segment --json " + folder_.file(name);
  };
  EXPECT_TRUE(refuses(segment("missing.pcd"), "missing.pcd: no such file"));
  folder_.write("text.pcd", "not a cloud\n");
  EXPECT_TRUE(refuses(segment("text.pcd"), "text.pcd"));
  folder_.write("nothing.pcd", "");
  EXPECT_TRUE(refuses(segment("nothing.pcd"), "nothing.pcd"));
  fs::copy(folder_.file("three.pcd"), folder_.file("cut.pcd"));
  for (const double share : {0.9, 0.5, 0.0001}) {
    truncateFile(folder_.file("cut.pcd"), share);
    EXPECT_TRUE(refuses(segment("cut.pcd"), "cut.pcd")) << share;
  }
  folder_.write("zero.pcd",
                "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 0\n"
                "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 0\nDATA ascii\n");
  EXPECT_TRUE(refuses(segment("zero.pcd"), "zero.pcd"));
  folder_.write("flat.pcd",
                "VERSION 0.7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 1\n"
                "HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n1 2\n");
  EXPECT_TRUE(refuses(segment("flat.pcd"), "flat.pcd"));
  folder_.write("frame/gt.json", "{}");
  EXPECT_TRUE(refuses(segment("frame"), "no depth.png"));
}

TEST_F(TabletopProgram, RefusesBadOptions) {
  const auto configured = [&](const std::string& yaml) {
    return "segment " + three_pcd_ + "--config " + folder_.write("options.yaml", yaml);
  };
  EXPECT_TRUE(refuses(configured("filter: {leaf_sise: 0.01}\n"), "filter.leaf_sise"));
  EXPECT_TRUE(refuses(configured("filtre: {leaf_size: 0.01}\n"), "filtre"));
  EXPECT_TRUE(refuses(configured("filter: {leaf_size: -0.01}\n"),
                      "filter.leaf_size must be between 0 and 0.1, got -0.01"));
  EXPECT_TRUE(refuses(configured("filter: {leaf_size: wide}\n"), "filter.leaf_size"));
  EXPECT_TRUE(refuses(configured("filter: [\n"), "options.yaml"));
  EXPECT_TRUE(
      refuses("segment " + three_pcd_ + "--config missing.yaml", "missing.yaml: no such file"));
}

TEST_F(TabletopProgram, RefusesOutputsThatWouldBeLost) {
  EXPECT_TRUE(
      refuses("segment " + three_pcd_ + "--output " + folder_.file("no/folder.pcd"), "folder.pcd"));
  const auto twice =
      runTabletop("segment " + three_pcd_ + three_pcd_ + "--output " + folder_.file("labels"));
  EXPECT_EQ(twice.exit_code, 2);
  EXPECT_NE(twice.err.find("two scenes are named three"), std::string::npos);
  const auto one_file =
      runTabletop("segment " + three_pcd_ + three_pcd_ + "--output " + folder_.file("labels.pcd"));
  EXPECT_EQ(one_file.exit_code, 2);
  EXPECT_NE(one_file.err.find("give a folder"), std::string::npos);
}

TEST_F(TabletopProgram, SegmentPrintsOneJsonObjectPerScene) {
  const auto empty_pcd = save(folder_, "empty.pcd", scene::render({}).cloud);
  // The bracket and the block have hollows: uncut, they are one thing each.
  const auto uncut = folder_.write("uncut.yaml", "split: {enabled: false}\n");
  const auto ran = runTabletop("segment --json " + empty_pcd + three_pcd_ + upOf(three_.up) +
                               " --config " + uncut);
  EXPECT_EQ(ran.exit_code, 0);
  EXPECT_TRUE(ran.err.empty()) << ran.err;
  const auto scenes = linesOf(ran.out);
  ASSERT_EQ(scenes.size(), 2u);
  EXPECT_EQ(scenes[0]["scene"], "empty");
  EXPECT_EQ(scenes[1]["scene"], "three");
  for (const auto& result : scenes) expectNullOnlyForReasons(result, "");

  const auto& plane = scenes[1]["table"]["plane"];
  EXPECT_GT(vectorOf(plane).dot(three_.plane.head<3>()), std::cos(0.2 * M_PI / 180));
  EXPECT_NEAR(plane[3].get<double>(), three_.plane[3], 0.002);
  ASSERT_EQ(scenes[1]["objects"].size(), 3u);
  for (const auto& object : scenes[1]["objects"]) EXPECT_FALSE(object.contains("name"));
  EXPECT_GT(scenes[1]["times_ms"]["total"].get<double>(), 0);
}

TEST_F(TabletopProgram, SegmentPrintsATableForPeople) {
  const auto ran = runTabletop("segment " + three_pcd_ + upOf(three_.up));
  EXPECT_EQ(ran.exit_code, 0);
  for (const auto* part : {"three\n", "table: normal", "tilt 0.", "box: centre", "total"})
    EXPECT_NE(ran.out.find(part), std::string::npos) << part << " in\n" << ran.out;
}

TEST_F(TabletopProgram, SegmentWritesALabelForEveryPointOfTheScene) {
  const auto uncut = folder_.write("uncut.yaml", "split: {enabled: false}\n");
  const auto ran = runTabletop("segment " + three_pcd_ + "--output " + folder_.file("out.pcd") +
                               " --config " + uncut);
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto written = readPcd(folder_.file("out.pcd"));
  EXPECT_EQ(written.cloud.width, three_.cloud.width);
  EXPECT_EQ(written.cloud.height, three_.cloud.height);
  EXPECT_EQ(written.cloud.rgb, three_.cloud.rgb);
  EXPECT_EQ(validIndices(written.cloud), validIndices(three_.cloud));
  const int last = validIndices(three_.cloud).back();
  EXPECT_EQ(written.cloud.point(last), three_.cloud.point(last));
  EXPECT_GT(overlap(three_.truth, 1, written.labels, 1), 0.95);
  for (const std::uint32_t label : {2, 3, 4})
    EXPECT_GT(bestOverlap(three_.truth, label, written.labels), 0.85) << label;
}

TEST_F(TabletopProgram, SegmentLabelsEveryPointOfAThinnedCloud) {
  folder_.write("thin.yaml", "filter: {leaf_size: 0.004}\ncluster: {min_points: 50}\n");
  const auto ran = runTabletop("segment " + three_pcd_ + "--config " + folder_.file("thin.yaml") +
                               " --output " + folder_.file("labels"));
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto written = readPcd(folder_.file("labels/three.pcd"));
  EXPECT_EQ(written.cloud.width, three_.cloud.width);
  EXPECT_GT(overlap(three_.truth, 1, written.labels, 1), 0.95);
  for (const std::uint32_t label : {2, 3, 4})
    EXPECT_GT(bestOverlap(three_.truth, label, written.labels), 0.85) << label;
}

TEST_F(TabletopProgram, SegmentTakesAnUnorganisedCloud) {
  const auto ran =
      runTabletop("segment --json " + save(folder_, "heap.pcd",
                                           selectPoints(three_.cloud, validIndices(three_.cloud))));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(linesOf(ran.out).at(0)["objects"].size(), 3u);
}

TEST_F(TabletopProgram, SegmentSaysWhyThereIsNoTable) {
  scene::SceneOptions bare;
  bare.table_x = bare.table_y = 0;
  const auto floating =
      scene::render({{"ball", scene::ball(0.03), Eigen::Isometry3d::Identity()}}, bare);
  for (const auto& file : {save(folder_, "ball.pcd", floating.cloud),
                           save(folder_, "blind.pcd", Cloud(64, 48, false))}) {
    const auto ran = runTabletop("segment --json " + file);
    EXPECT_EQ(ran.exit_code, 1) << file;
    EXPECT_TRUE(ran.err.empty()) << ran.err;
    const auto result = linesOf(ran.out).at(0);
    EXPECT_TRUE(result["table"].is_null()) << file;
    EXPECT_TRUE(result["objects"].empty()) << file;
    EXPECT_TRUE(result["reason"].is_string()) << file;
  }
}

TEST_F(TabletopProgram, SegmentSaysThatNothingStandsOnTheTable) {
  const auto ran =
      runTabletop("segment --json " + save(folder_, "empty.pcd", scene::render({}).cloud));
  EXPECT_EQ(ran.exit_code, 1);
  const auto result = linesOf(ran.out).at(0);
  EXPECT_TRUE(result["table"].is_object());
  EXPECT_NE(result["reason"].get<std::string>().find("nothing stands on it"), std::string::npos);
}

TEST_F(TabletopProgram, TheUpDirectionOfADepthFolderCountsUnlessOneIsStated) {
  // A wall 1 m ahead: as a table it lies only where up is towards the camera.
  folder_.write("wall/gt.json",
                R"({"camera": {"fx": 100, "fy": 100, "cx": 49.5, "cy": 49.5,
                    "width": 100, "height": 100}, "depth_unit_m": 0.001, "up": [0, -1, 0]})");
  cv::imwrite(folder_.file("wall/depth.png"), cv::Mat(100, 100, CV_16UC1, cv::Scalar(1000)));
  const auto segment = "segment --json " + folder_.file("wall");
  const auto by_file = linesOf(runTabletop(segment).out).at(0);
  EXPECT_TRUE(by_file["table"].is_null());
  EXPECT_NE(by_file["reason"].dump().find("90 deg from up"), std::string::npos) << by_file;
  EXPECT_TRUE(linesOf(runTabletop(segment + " --up 0 0 -5").out).at(0)["table"].is_object());
}

TEST_F(TabletopProgram, ResultsAreInTheFrameOfTheFile) {
  const Eigen::Vector3d sensor(0.5, -0.25, 1);
  PcdContents contents;
  contents.cloud = three_.cloud;
  for (const int i : validIndices(contents.cloud))
    contents.cloud.setPoint(i, contents.cloud.point(i) + sensor.cast<float>());
  contents.T_data_sensor.translation() = sensor;
  writePcd(folder_.file("moved.pcd"), contents);

  const auto ran = runTabletop("segment --json " + three_pcd_ + folder_.file("moved.pcd") +
                               " --output " + folder_.file("labels"));
  const auto results = linesOf(ran.out);
  ASSERT_EQ(results.size(), 2u);
  ASSERT_EQ(results[0]["objects"].size(), results[1]["objects"].size());
  const json::json_pointer position("/objects/0/pose/position");
  EXPECT_LT((vectorOf(results[1][position]) - vectorOf(results[0][position]) - sensor).norm(),
            1e-4);
  const auto labelled = readPcd(folder_.file("labels/moved.pcd"));
  const int last = validIndices(contents.cloud).back();
  EXPECT_LT((labelled.cloud.point(last) - contents.cloud.point(last)).norm(), 1e-6);
  EXPECT_TRUE(labelled.T_data_sensor.translation().isApprox(sensor));
}

TEST_F(TabletopProgram, RefusesAnEmptyOrMissingDatabase) {
  const auto recognize = "recognize " + three_pcd_ + "--database ";
  EXPECT_TRUE(refuses(recognize + folder_.file("missing.db"), "missing.db"));
  ObjectDatabase(folder_.file("empty.db"), ObjectDatabase::Mode::WRITE);
  EXPECT_TRUE(refuses(recognize + folder_.file("empty.db"), "empty.db: no object"));
  EXPECT_TRUE(refuses(recognize + folder_.write("text.db", "hello"), "text.db"));
}

TEST_F(TabletopProgram, RecognizeNamesTheObjectsAndTheirPoses) {
  {
    ObjectDatabase database(folder_.file("objects.db"), ObjectDatabase::Mode::WRITE);
    for (const auto& object : three_.objects)
      database.store(trainFromMesh(object.name, object.mesh, DescriptorOptions(), [](double) {}));
  }
  const auto database = "--database " + folder_.file("objects.db");
  const auto ran = runTabletop("recognize --json " + three_pcd_ + upOf(three_.up) + database +
                               " --output " + folder_.file("results"));
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_TRUE(ran.err.empty()) << ran.err;
  EXPECT_EQ(textOf(folder_.file("results/three.json")), ran.out);
  const auto result = linesOf(ran.out).at(0);
  expectNullOnlyForReasons(result, "");
  for (const auto& truth : three_.objects) {
    const json* found = nullptr;
    for (const auto& object : result["objects"])
      if (object["name"] == truth.name) found = &object;
    ASSERT_TRUE(found) << truth.name << " in " << ran.out;
    const Eigen::Vector3d position = vectorOf((*found)["pose"]["position"]);
    EXPECT_LT((position - truth.T_camera_object.translation()).norm(), 0.005) << truth.name;
    EXPECT_GT((*found)["score"].get<double>(), 0.5);
    EXPECT_LE((*found)["visible"].get<double>(), 1);
  }

  const auto text = runTabletop("recognize " + three_pcd_ + database);
  EXPECT_EQ(text.exit_code, 0);
  for (const auto* part : {"bracket", "house", "steps", "position x y z [m]", "total"})
    EXPECT_NE(text.out.find(part), std::string::npos) << part << " in\n" << text.out;
}

TEST_F(TabletopProgram, BenchmarksStagesBesideStockPcl) {
  const auto ran = runTabletop("benchmark --json --runs 2 " + three_pcd_ + three_pcd_);
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto lines = linesOf(ran.out);
  ASSERT_EQ(lines.size(), 2u) << ran.out;
  EXPECT_EQ(lines[0]["scene"], "three");
  EXPECT_TRUE(lines[0]["reason"].is_null());
  std::vector<std::string> names;
  for (const auto& stage : lines[0]["stages"]) {
    names.push_back(stage["name"]);
    EXPECT_GT(stage["ratio"].get<double>(), 0) << stage;
    EXPECT_NEAR(stage["ratio"].get<double>() * stage["ours_ms"].get<double>(),
                stage["pcl_ms"].get<double>(), 1e-6);
    EXPECT_LE(stage["ours_ms"], stage["ours_median_ms"]);
    EXPECT_LE(stage["pcl_ms"], stage["pcl_median_ms"]);
    EXPECT_EQ(stage["runs"], 2);
  }
  EXPECT_EQ(names, (std::vector<std::string>{"crop", "voxel_grid", "normals", "plane", "clusters",
                                             "clusters_organized", "front_end", "pick_decimate",
                                             "pick_window", "pick_plane", "pick_box",
                                             "pick_cluster", "pick_frame", "pick"}));
  EXPECT_GT(lines[0]["split"]["ours_ms"].get<double>(), 0);
  EXPECT_GT(lines[0]["memory"]["process_peak_mb"].get<double>(), 1);

  const auto text = runTabletop("benchmark --runs 1 " + three_pcd_);
  ASSERT_EQ(text.exit_code, 0) << text.err;
  EXPECT_NE(text.out.find("\nworst ratios: crop "), std::string::npos) << text.out;
}

TEST_F(TabletopProgram, RecognizeSaysWhyAThingIsUnknown) {
  ObjectDatabase(folder_.file("objects.db"), ObjectDatabase::Mode::WRITE)
      .store(trainFromMesh("bracket", scene::bracket(), DescriptorOptions(), [](double) {}));
  const auto can = scene::render({{"can", scene::cylinder(0.04, 0.2), scene::standing(0, 0, 0)}});
  const auto ran = runTabletop("recognize --json " + save(folder_, "can.pcd", can.cloud) +
                               "--database " + folder_.file("objects.db"));
  EXPECT_EQ(ran.exit_code, 1) << ran.err;
  const auto objects = linesOf(ran.out).at(0)["objects"];
  ASSERT_EQ(objects.size(), 1u);
  EXPECT_EQ(objects[0]["name"], "unknown");
  EXPECT_EQ(objects[0]["pose"], objects[0]["box"]["pose"]);
  EXPECT_TRUE(objects[0]["reason"].is_string());
}

/// Words that point at a point.
std::string pointAt(const Eigen::Vector3d& p) {
  std::ostringstream text;
  text << "--point " << p.x() << " " << p.y() << " " << p.z();
  return text.str();
}

/// Words that point at the pixel of a point.
std::string pixelAt(const Eigen::Vector3d& p) {
  const Eigen::Vector2d pixel = scene::SceneOptions().projection.pixel(p);
  std::ostringstream text;
  text << "--pixel " << pixel.x() << " " << pixel.y();
  return text.str();
}

/// The middle of the lower step of the stepped block, in the camera's frame.
Eigen::Vector3d stepOf(const scene::SyntheticScene& three) {
  return three.objects.at(2).T_camera_object * Eigen::Vector3d(0.035, 0, 0.04);
}

TEST_F(TabletopProgram, PickByPixelAndByPointGivesOneThingAndItsFrames) {
  const auto pick = [&](const std::string& where) {
    const auto ran = runTabletop("pick --json " + three_pcd_ + where);
    EXPECT_EQ(ran.exit_code, 0) << ran.out;
    return linesOf(ran.out).at(0);
  };
  const auto picked = pick(pixelAt(stepOf(three_)));
  expectNullOnlyForReasons(picked, "");
  EXPECT_EQ(picked["name"], "unknown");
  EXPECT_EQ(picked["pose"], picked["frame"]);
  EXPECT_GT(vectorOf(picked["plane"]).dot(three_.up), 0.999);
  const Eigen::Vector3d from_thing = vectorOf(picked["pregrasp"]["pose"]["position"]) -
                                     three_.objects[2].T_camera_object.translation();
  EXPECT_LT(from_thing.cross(three_.up).norm(), 0.02);       // above it,
  EXPECT_NEAR(from_thing.dot(three_.up), 0.14 + 0.1, 0.01);  // its height and the approach
  EXPECT_NEAR(picked["pregrasp"]["width"].get<double>(), 0.12, 0.01);  // 10 cm and the margin
  EXPECT_EQ(pick(pointAt(stepOf(three_)))["frame"], picked["frame"]);

  const auto text = runTabletop("pick " + three_pcd_ + pixelAt(stepOf(three_)));
  EXPECT_EQ(text.exit_code, 0);
  for (const auto* part : {"frame", "pregrasp", "the gripper opens", "total"})
    EXPECT_NE(text.out.find(part), std::string::npos) << part << " in\n" << text.out;
}

TEST_F(TabletopProgram, PickWithADatabaseNamesTheThing) {
  {
    ObjectDatabase database(folder_.file("objects.db"), ObjectDatabase::Mode::WRITE);
    for (const auto& object : three_.objects)
      database.store(trainFromMesh(object.name, object.mesh, DescriptorOptions(), [](double) {}));
  }
  const auto pick = "pick --json " + three_pcd_ + pixelAt(stepOf(three_)) + " --database " +
                    folder_.file("objects.db") + " --model ";
  const auto ran = runTabletop(pick + "steps");
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  const auto picked = linesOf(ran.out).at(0);
  EXPECT_EQ(picked["name"], "steps") << ran.out;
  const Eigen::Vector3d position = vectorOf(picked["pose"]["position"]);
  EXPECT_LT((position - three_.objects[2].T_camera_object.translation()).norm(), 0.005);

  const auto other = linesOf(runTabletop(pick + "house").out).at(0);
  EXPECT_EQ(other["name"], "unknown");
  EXPECT_TRUE(other["reason"].is_string());
  EXPECT_EQ(other["frame"], picked["frame"]);
  EXPECT_TRUE(refuses(pick + "horse", "holds no object 'horse'"));
}

TEST_F(TabletopProgram, PickSaysWhyThereIsNothing) {
  const auto nothing = [&](const std::string& where, const std::string& reason) {
    const auto ran = runTabletop("pick --json " + three_pcd_ + where);
    EXPECT_EQ(ran.exit_code, 1) << ran.out;
    const auto result = linesOf(ran.out).at(0);
    EXPECT_TRUE(result["frame"].is_null());
    EXPECT_NE(result["reason"].dump().find(reason), std::string::npos) << result;
  };
  nothing("--pixel 640 10", "outside the image of 640 x 480");
  nothing("--pixel -3 10", "outside the image");
  nothing(pointAt(stepOf(three_) + 0.2 * three_.up), "in the air");
  nothing(pointAt(three_.T_camera_table * Eigen::Vector3d(-0.2, 0.1, 0)), "on the table");
  EXPECT_TRUE(refuses("pick " + three_pcd_, "--pixel"));
  EXPECT_TRUE(refuses("pick " + three_pcd_ + "--pixel 1", "--pixel"));
  EXPECT_TRUE(refuses("pick " + three_pcd_ + "--pixel 1 2 --point 0 0 1", "--p"));
  EXPECT_TRUE(refuses("pick " + three_pcd_ + "--pixel 1 2 --model house", "--database"));
}

TEST(Simulate, SameSeedGivesTheSameBytesAndScenesThatAreRead) {
  const TempFolder folder;
  const auto mesh = folder.write(
      "wedge.obj",
      "v 0 0 0\nv 0.12 0 0\nv 0 0.1 0\nv 0 0 0.14\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  const auto make = [&](const std::string& output, int scenes) {
    const auto ran =
        runTabletop("simulate --mesh wedge=" + mesh + " --scenes " + std::to_string(scenes) +
                    " --objects 2 --gap 0.06 --seed 3 --output " + folder.file(output));
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(ran.out.empty());
  };
  make("a", 2);
  make("b", 1);
  for (const auto* name : {"depth.png", "color.png", "label.png", "gt.json"}) {
    const auto bytes = textOf(folder.file("a/000000/") + name);
    EXPECT_FALSE(bytes.empty()) << name;
    EXPECT_EQ(bytes, textOf(folder.file("b/000000/") + name)) << name;
    EXPECT_NE(bytes, textOf(folder.file("a/000001/") + name)) << name;
  }
  // label.png agrees with gt.json, and `segment` finds the table that gt.json states.
  const auto truth = json::parse(textOf(folder.file("a/000000/gt.json")));
  const auto labels = cv::imread(folder.file("a/000000/label.png"), cv::IMREAD_UNCHANGED);
  for (const auto& object : truth["objects"])
    EXPECT_EQ(cv::countNonZero(labels == object["label_value"].get<int>()),
              object["visible_pixels"].get<int>());
  const auto segmented = runTabletop("segment --json " + folder.file("a/000000"));
  ASSERT_EQ(segmented.exit_code, 0) << segmented.err;
  const auto table = linesOf(segmented.out).at(0)["table"];
  ASSERT_FALSE(table.is_null());
  EXPECT_GT(vectorOf(table["plane"]).dot(vectorOf(truth["up"])), 0.999);
}

TEST(Simulate, BadInputIsRefusedInOneLine) {
  const TempFolder folder;
  const auto rest = " --scenes 1 --objects 1 --gap 0 --seed 1 --output " + folder.file("out");
  EXPECT_TRUE(refuses("simulate --models " + folder.file("none") + rest, "must be a folder"));
  EXPECT_TRUE(refuses("simulate --mesh a=" + folder.file("none.ply") + rest, "no such file"));
  EXPECT_TRUE(refuses("simulate --mesh a" + rest, "NAME=FILE"));
}

}  // namespace
}  // namespace tabletop_perception::tools
