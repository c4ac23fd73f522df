#include "evaluate.h"
#include "tabletop_perception/database.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include <gtest/gtest.h>

#include "commands.h"
#include "printed.h"
#include "tabletop_perception/pcd.h"
#include "temp_folder.h"
#include "wedge_model.h"

namespace tabletop_perception::tools {
namespace {

using nlohmann::json;
using Labels = std::vector<std::uint32_t>;

/// What `evaluate` prints.
std::string evaluate(const std::string& words) {
  return printedBy(addEvaluate, "evaluate " + words);
}

/// The line with which `evaluate` ends for bad input.
std::string complaint(const std::string& words) {
  try {
    evaluate(words);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

#define EXPECT_MENTIONS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

/// Lines of a table by their first word.
std::map<std::string, std::string> linesOf(const std::string& text) {
  std::map<std::string, std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines[line.substr(0, line.find(' '))] = line;
  return lines;
}

class EvaluateLabels : public testing::Test {
 protected:
  EvaluateLabels() {
    std::filesystem::create_directories(folder.file("truth"));
    std::filesystem::create_directories(folder.file("results"));
  }

  /// A cloud of 1000 points a row, each row with one label.
  void writeCloud(const std::string& name, const Labels& row_labels) const {
    PcdContents contents;
    contents.cloud = Cloud(1000, static_cast<int>(row_labels.size()), false);
    for (std::size_t i = 0; i < contents.cloud.size(); ++i)
      contents.cloud.setPoint(i, {0, 0, 1 + 0.001f * i});
    for (const auto label : row_labels) contents.labels.insert(contents.labels.end(), 1000, label);
    writePcd(folder.file(name), contents);
  }

  std::string words() const {
    return "--labels " + folder.file("truth") + " --results " + folder.file("results");
  }

  TempFolder folder;
};

TEST_F(EvaluateLabels, givesTheFiguresOfScenesCategoriesAndAll) {
  writeCloud("truth/a.pcd", {1, 1, 20, 30});
  writeCloud("results/a.pcd", {1, 1, 2, 3});
  writeCloud("truth/b.pcd", {1, 1, 20, 30});
  writeCloud("results/b.pcd", {1, 0, 2, 2});
  folder.write("truth/gt_summary.json",
               R"({"scenes": [{"file": "x/b.pcd", "category": "stacked"},
                              {"file": "x/a.pcd", "category": "apart"}]})");
  const auto figures = json::parse(evaluate(words() + " --json"));
  EXPECT_EQ(figures["scenes"][0]["scene"], "b");
  EXPECT_EQ(figures["scenes"][0]["f"], 0.5);
  EXPECT_EQ(figures["scenes"][0]["table_iou"], 0.5);
  EXPECT_EQ(figures["scenes"][0]["matches"].size(), 2u);
  EXPECT_EQ(figures["categories"][1]["category"], "apart");
  EXPECT_EQ(figures["categories"][1]["f"], 1.0);
  EXPECT_EQ(figures["all"]["scenes"], 2);
  EXPECT_EQ(figures["all"]["f"], 0.75);
  EXPECT_EQ(figures["all"]["recall_iou_75"], 0.5);
  EXPECT_EQ(figures["all"]["table_iou"], 0.75);

  const auto lines = linesOf(evaluate(words()));
  EXPECT_MENTIONS(lines.at("b"), " 50.0 ");
  EXPECT_MENTIONS(lines.at("apart"), "100.0");
  EXPECT_MENTIONS(lines.at("all"), " 75.0 ");
}

TEST_F(EvaluateLabels, aSceneWithoutAResultCountsAsNothingFoundAndIsNamed) {
  writeCloud("truth/a.pcd", {1, 20});
  writeCloud("results/a.pcd", {1, 2});
  writeCloud("truth/lost.pcd", {1, 20});
  testing::internal::CaptureStderr();
  const auto figures = json::parse(evaluate(words() + " --json"));
  EXPECT_MENTIONS(testing::internal::GetCapturedStderr(), "scene lost counts as nothing found");
  EXPECT_EQ(figures["scenes"][1]["has_result"], false);
  EXPECT_EQ(figures["scenes"][1]["f"], 0.0);
  EXPECT_EQ(figures["categories"][0]["category"], "all");
  EXPECT_EQ(figures["all"]["f"], 0.5);
}

TEST_F(EvaluateLabels, complainsAboutBadInput) {
  EXPECT_MENTIONS(complaint(words()), "must be a folder of .pcd files");
  writeCloud("truth/a.pcd", {1, 20});
  EXPECT_MENTIONS(complaint(words()), "no result for any of the 1 scenes");
  EXPECT_MENTIONS(complaint("--labels " + folder.file("none") + " --results " + folder.file("")),
                  "--labels must be a folder, got");
  EXPECT_MENTIONS(complaint("--labels " + folder.file("truth") + " --results none"),
                  "--results must be a folder, got 'none'");
  writeCloud("results/a.pcd", {1, 2, 3});
  EXPECT_MENTIONS(complaint(words()),
                  "a.pcd must have the size of its truth, 1000 x 2, got 1000 x 3");
}

TEST_F(EvaluateLabels, complainsAboutACloudWithoutLabelsAndABrokenSummary) {
  writeCloud("truth/a.pcd", {1, 20});
  PcdContents unlabelled;
  unlabelled.cloud = Cloud(1000, 2, false);
  writePcd(folder.file("results/a.pcd"), unlabelled);
  EXPECT_MENTIONS(complaint(words()), "results/a.pcd must have a field `label`");
  folder.write("truth/gt_summary.json", R"({"scenes": [{"file": "a.pcd"}]})");
  EXPECT_MENTIONS(complaint(words()), "gt_summary.json cannot be understood");
}

class EvaluatePoses : public testing::Test {
 protected:
  EvaluatePoses() {
    writeWedgeModel(folder);
    folder.write("truth/s1/gt.json", truthOf({"[0, 0, 1]", "[0.3, 0, 1]"}));
    std::filesystem::create_directories(folder.file("results"));
  }

  static std::string truthOf(const std::vector<std::string>& translations) {
    json objects = json::array();
    for (const auto& translation : translations) {
      const auto t = json::parse(translation);
      objects.push_back(
          {{"name", "wedge"},
           {"model_to_camera_3x4", {{1, 0, 0, t[0]}, {0, 1, 0, t[1]}, {0, 0, 1, t[2]}}}});
    }
    return json{{"objects", objects}}.dump();
  }

  static json result(const std::string& name, double x) {
    return {{"name", name}, {"pose", {{"position", {x, 0, 1}}, {"orientation", {0, 0, 0, 1}}}}};
  }

  void writeResult(const json& objects) const {
    folder.write("results/s1.json", json{{"objects", objects}}.dump());
  }

  std::string words() const {
    return "--poses " + folder.file("truth") + " --models " + folder.file("models") +
           " --results " + folder.file("results");
  }

  TempFolder folder;
};

TEST_F(EvaluatePoses, givesTheFiguresOfScenesObjectsAndAll) {
  writeResult({result("wedge", 0.004),
               result("wedge", 0.33),
               result("pot", 0.6),
               {{"name", "unknown"}, {"pose", nullptr}}});
  const auto figures = json::parse(evaluate(words() + " --json"));
  const auto& all = figures["all"];
  EXPECT_EQ(all["objects"], 2);
  EXPECT_EQ(all["results"], 3);
  EXPECT_EQ(all["right"], 1);
  EXPECT_EQ(all["named_recall"], 1.0);
  EXPECT_DOUBLE_EQ(all["precision"], 1.0 / 3);
  EXPECT_NEAR(all["median_translation"], 0.004, 1e-9);
  EXPECT_NEAR(figures["scenes"][0]["matches"][1]["mssd"], 0.03, 1e-6);
  EXPECT_EQ(figures["objects"][0]["name"], "pot");
  EXPECT_EQ(figures["objects"][0]["right_recall"], nullptr);
  EXPECT_EQ(figures["objects"][1]["precision"], 0.5);

  const auto lines = linesOf(evaluate(words()));
  EXPECT_MENTIONS(lines.at("s1"), " 1/2 ");
  EXPECT_MENTIONS(lines.at("wedge"), " 50.0 ");
  EXPECT_MENTIONS(lines.at("all"), " 4.0");
}

TEST_F(EvaluatePoses, aSceneWithoutAResultCountsAsNothingFoundAndIsNamed) {
  writeResult({result("wedge", 0), result("wedge", 0.3)});
  folder.write("truth/s2/gt.json", truthOf({"[0, 0, 1]", "[0.3, 0, 1]"}));
  testing::internal::CaptureStderr();
  const auto figures = json::parse(evaluate(words() + " --json"));
  EXPECT_MENTIONS(testing::internal::GetCapturedStderr(), "scene s2 counts as nothing found");
  EXPECT_EQ(figures["scenes"][1]["has_result"], false);
  EXPECT_EQ(figures["all"]["right_recall"], 0.5);
  EXPECT_EQ(figures["all"]["precision"], 1.0);
}

TEST_F(EvaluatePoses, tellsHowHighTheTrueObjectsStandAboveTheTableThatWasFound) {
  // The wedges reach from z = 1 to z = 1.05, the table lies across z at 1.01 and faces the camera.
  const json table = {{"plane", {0, 0, -1, 1.01}}};
  folder.write("results/s1.json",
               json{{"objects", json::array({result("wedge", 0)})}, {"table", table}}.dump());
  const auto figures = json::parse(evaluate(words() + " --json"));
  ASSERT_EQ(figures["scenes"][0]["lowest_above_table"].size(), 2u);
  EXPECT_NEAR(figures["scenes"][0]["lowest_above_table"][0], 0.01 - 0.05, 1e-6);
  EXPECT_MENTIONS(linesOf(evaluate(words())).at("s1"), "-40.0 to -40.0");

  folder.write("results/s1.json",
               json{{"objects", json::array({result("wedge", 0)})}, {"table", nullptr}}.dump());
  EXPECT_MENTIONS(linesOf(evaluate(words())).at("s1"), "no table");
}

TEST_F(EvaluatePoses, aNameForAnUnknownThingIsAFalseAccept) {
  // Two wedges, one of which was not taught under its name, a "stone".
  auto truth = json::parse(truthOf({"[0, 0, 1]", "[0.3, 0, 1]"}));
  truth["objects"][1]["name"] = "stone";
  folder.write("truth/s1/gt.json", truth.dump());
  std::filesystem::create_directories(folder.file("models/stone"));
  std::filesystem::copy_file(folder.file("models/wedge/mesh.ply"),
                             folder.file("models/stone/mesh.ply"));
  const auto all = [&] {
    return json::parse(evaluate(words() + " --unknown stone --json"))["all"];
  };
  writeResult(json::array({result("wedge", 0)}));
  EXPECT_EQ(all()["objects"], 1);
  EXPECT_EQ(all()["unknown"], 1);
  EXPECT_EQ(all()["false_accepts"], 0);
  writeResult({result("wedge", 0), result("wedge", 0.31)});
  EXPECT_EQ(all()["false_accepts"], 1);
  EXPECT_EQ(all()["precision"], 0.5);
  writeResult({result("wedge", 0), result("wedge", 0.02)});  // a second name, for the known thing
  EXPECT_EQ(all()["false_accepts"], 0);
  EXPECT_MENTIONS(complaint(words() + " --unknown sand"), "no object of that name");
}

TEST_F(EvaluatePoses, countsTheRightOnesByVisibilityAndTheTimes) {
  auto truth = json::parse(truthOf({"[0, 0, 1]", "[0.3, 0, 1]"}));
  truth["objects"][0]["visible_share"] = 1.0;
  truth["objects"][1]["visible_share"] = 0.35;
  folder.write("truth/s1/gt.json", truth.dump());
  folder.write("results/s1.json",
               json{{"objects", {result("wedge", 0)}}, {"times_ms", {{"total", 12.5}}}}.dump());
  const auto all = json::parse(evaluate(words() + " --json"))["all"];
  ASSERT_EQ(all["visibility"].size(), 5u);
  EXPECT_EQ(all["visibility"][1]["objects"], 1);
  EXPECT_EQ(all["visibility"][1]["right"], 0);
  EXPECT_EQ(all["visibility"][4]["objects"], 1);
  EXPECT_EQ(all["visibility"][4]["right"], 1);
  EXPECT_EQ(all["time_ms"], 12.5);
  EXPECT_EQ(all["bop_recall"], nullptr);  // without a depth image
}

TEST_F(EvaluatePoses, whatIsHardlyVisibleNeedNotBeFoundButMayBe) {
  auto truth = json::parse(truthOf({"[0, 0, 1]", "[0.3, 0, 1]"}));
  truth["objects"][0]["visible_share"] = 0.8;
  truth["objects"][1]["visible_share"] = 0.35;
  folder.write("truth/s1/gt.json", truth.dump());
  const auto all = [&] {
    return json::parse(evaluate(words() + " --min-visible 0.5 --json"))["all"];
  };
  writeResult(json::array({result("wedge", 0)}));
  EXPECT_EQ(all()["objects"], 1);
  EXPECT_EQ(all()["right_recall"], 1.0);
  writeResult({result("wedge", 0.3), result("wedge", 0)});
  EXPECT_EQ(all()["results"], 1) << "right about the hidden one: neither good nor bad";
  EXPECT_EQ(all()["right"], 1);
  writeResult({result("wedge", 0), result("wedge", 0.34)});
  EXPECT_EQ(all()["precision"], 0.5) << "wrong about it";
}

TEST_F(EvaluatePoses, judgesAPoseThatCannotBeToldByAddS) {
  // Turned by 0.2 rad about z: one vertex of four is off by 40 mm, another by 20; 22 are allowed.
  auto turned = result("wedge", 0);
  turned["pose"]["orientation"] = {0, 0, std::sin(0.1), std::cos(0.1)};
  writeResult({turned, result("wedge", 0.3)});
  const auto all = [&](const std::string& more) {
    return json::parse(evaluate(words() + more + " --json"))["all"];
  };
  EXPECT_EQ(all("")["right"], 1);
  EXPECT_EQ(all(" --by-add-s s1/wedge")["right"], 2);
  EXPECT_MENTIONS(complaint(words() + " --by-add-s s2/wedge"), "no such SCENE/NAME");
}

TEST_F(EvaluatePoses, fitsTheWeightsOfTheScore) {
  const auto withVisible = [](double x, double visible) {
    auto one = result("wedge", x);
    one["evidence"] = {{"explained", 0.9}, {"fitness", 0.002}, {"visible", visible},
                       {"hidden", 0.1},    {"violation", 0.0}, {"rms", 0.001},
                       {"area", 0.01},     {"margin", 1.0},    {"lift", 0.0}};
    return one;
  };
  writeResult({withVisible(0, 0.9), withVisible(0.3, 0.8), withVisible(0.6, 0.2)});
  const auto fit = json::parse(evaluate(words() + " --fit --json"));
  EXPECT_EQ(fit["results"], 3);
  EXPECT_GT(fit["weights"]["visible"], 0) << "the one that is wrong is seen least";
  EXPECT_LT(fit["fitted_loss"], 0.3);
  writeResult(json::array({result("wedge", 0)}));
  EXPECT_MENTIONS(complaint(words() + " --fit"), "no result with a name says its evidence");
}

TEST_F(EvaluatePoses, complainsAboutBadResults) {
  EXPECT_MENTIONS(complaint(words()), "no result for any of the 1 scenes");
  folder.write("results/s1.json", "{\"objects\": [");
  EXPECT_MENTIONS(complaint(words()), "s1.json cannot be understood");
  folder.write("results/s1.json", R"({"objects": [{"name": "wedge", "pose": null}]})");
  EXPECT_MENTIONS(complaint(words()), "s1.json cannot be understood");
  auto object = result("wedge", 0);
  object["pose"]["orientation"] = {0, 0, 0, 0};
  writeResult(json::array({object}));
  EXPECT_MENTIONS(complaint(words()), "wedge: orientation must be a unit quaternion");
}

TEST_F(EvaluatePoses, complainsAboutBadTruthAndModels) {
  writeResult(json::array({result("wedge", 0)}));
  EXPECT_MENTIONS(complaint("--poses " + folder.file("models") + " --models " +
                            folder.file("models") + " --results " + folder.file("results")),
                  "must be a folder of folders with a gt.json");
  folder.write("truth/s1/gt.json",
               R"({"objects": [{"name": "wedge", "model_to_camera_3x4":
                   [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]]}]})");
  EXPECT_MENTIONS(complaint(words()), "model_to_camera_3x4 must begin with a rotation");
  folder.write("truth/s1/gt.json", truthOf({"[0, 0, 1]"}));
  std::filesystem::remove_all(folder.file("models/wedge"));
  EXPECT_MENTIONS(complaint(words()), "wedge/mesh.ply");
}

TEST(EvaluateCommand, wantsOneTruthAndModelsForPoses) {
  EXPECT_THROW(evaluate("--results ."), CLI::ParseError);
  EXPECT_THROW(evaluate("--labels . --poses . --models . --results ."), CLI::ParseError);
  EXPECT_THROW(evaluate("--poses . --results ."), CLI::ParseError);
  EXPECT_THROW(evaluate("--labels . --models . --results ."), CLI::ParseError);
  EXPECT_THROW(evaluate("--labels ."), CLI::ParseError);
}

class EvaluateJitter : public testing::Test {
 protected:
  /// A frame that shows one thing, turned about z.
  void write(int frame, double x, double degrees, double deviation = 0) {
    const double half = degrees * M_PI / 360;
    auto covariance = std::vector<std::vector<double>>(6, std::vector<double>(6, 0));
    for (int i = 0; i < 6; ++i) covariance[i][i] = deviation * deviation;
    const json object = {
        {"name", "mug"},
        {"pose",
         {{"position", {x, 0, 1}}, {"orientation", {0, 0, std::sin(half), std::cos(half)}}}},
        {"covariance", covariance}};
    folder.write("results/000003_" + std::to_string(frame) + ".json",
                 json{{"objects", json::array({object})}}.dump());
  }

  json figures() const {
    return json::parse(evaluate("--jitter --json --results " + folder.file("results")));
  }

  TempFolder folder;
};

TEST_F(EvaluateJitter, TellsHowFarPosesLieFromTheirMean) {
  for (int frame = 0; frame < 4; ++frame) write(frame, frame % 2 * 0.002, frame % 2 * 2.0);
  const auto all = figures();
  ASSERT_EQ(all["objects"].size(), 1u);
  const auto& mug = all["objects"][0];
  EXPECT_EQ(mug["scene"], "000003");
  EXPECT_EQ(mug["seen"], 4);
  EXPECT_NEAR(mug["translation"]["mean"], 0.001, 1e-9);
  EXPECT_NEAR(mug["rotation"]["p95"], M_PI / 180, 1e-6);
  EXPECT_EQ(all["flips"], 0);
}

TEST_F(EvaluateJitter, CountsFlipsAndFramesWithoutTheThing) {
  write(0, 0, 0);
  write(1, 0, 90);
  write(2, 0, 91);
  folder.write("results/000003_3.json", R"({"objects": []})");
  const auto all = figures();
  EXPECT_EQ(all["flips"], 1);
  EXPECT_EQ(all["objects"][0]["seen"], 3);
  EXPECT_EQ(all["objects"][0]["frames"], 4);
}

TEST_F(EvaluateJitter, TellsWhatTheTrackerMakesOfThem) {
  for (int frame = 0; frame < 8; ++frame) write(frame, 0, frame == 5 ? 90 : 0, 0.001);
  const auto all = figures();
  EXPECT_EQ(all["flips"], 2);
  EXPECT_EQ(all["tracked_flips"], 0);
  EXPECT_NEAR(all["objects"][0]["tracked"]["rotation"]["p95"], 0, 1e-6);
}

TEST_F(EvaluateJitter, WithoutFramesThereIsNothingToEvaluate) {
  std::filesystem::create_directories(folder.file("results"));
  EXPECT_MENTIONS(complaint("--jitter --results " + folder.file("results")),
                  "no SCENE_FRAME.json in");
  EXPECT_THROW(evaluate("--jitter --results " + folder.file("results") + " --database " +
                        folder.file("missing.db")),
               DatabaseError);
}

}  // namespace
}  // namespace tabletop_perception::tools
