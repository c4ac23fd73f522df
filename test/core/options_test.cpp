#include "tabletop_perception/options.h"

#include <fstream>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "clouds.h"
#include "tabletop_perception/options_yaml.h"
#include "tabletop_perception/pipeline.h"

using namespace tabletop_perception;
using clouds::refusalOf;

namespace {

/// Options of every type.
struct Sample {
  double size = 0.5;
  int count = 3;
  bool on = false;
  std::string word = "a";

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("size", size, Range{0, 1});
    visit("count", count, Range{1, 10});
    visit("on", on);
    visit("word", word, Choices{{"a", "b"}});
  }
};

Sample parsed(const std::string& yaml) {
  Sample sample;
  readYaml("sample", YAML::Load(yaml), sample);
  return sample;
}

std::string refusalOfYaml(const std::string& yaml) {
  return refusalOf([&] { parsed(yaml); });
}

/// A yaml file that goes when the test ends.
class YamlFile {
 public:
  explicit YamlFile(const std::string& text)
      : path_(testing::TempDir() + "options_test_" +
              testing::UnitTest::GetInstance()->current_test_info()->name() + ".yaml") {
    std::ofstream(path_) << text;
  }
  ~YamlFile() { std::remove(path_.c_str()); }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

std::string refusalOfFile(const std::string& text) {
  const YamlFile file(text);
  const std::string refusal = refusalOf([&] { readPipelineOptions(file.path()); });
  EXPECT_EQ(refusal.find('\n'), std::string::npos) << "more than a line: " << refusal;
  EXPECT_EQ(refusal.find(file.path()), 0u) << "does not begin with the file: " << refusal;
  return refusal.substr(std::min(refusal.size(), file.path().size()));
}

/// Every option as "section.name = value".
std::vector<std::string> listOf(PipelineOptions options) {
  std::vector<std::string> list;
  options.visitStages([&](const std::string& section, auto& stage) {
    stage.visitFields([&](const std::string& name, auto& field, const auto&...) {
      std::ostringstream line;
      line << section << '.' << name << " = " << field;
      list.push_back(line.str());
    });
  });
  return list;
}

void expectSame(const PipelineOptions& a, const PipelineOptions& b) {
  const auto lines = listOf(a), others = listOf(b);
  ASSERT_EQ(lines.size(), others.size());
  for (std::size_t i = 0; i < lines.size(); ++i) EXPECT_EQ(lines[i], others[i]);
}

}  // namespace

TEST(Options, ValuesWithinTheirLimitsPass) {
  Sample sample;
  EXPECT_NO_THROW(checkOptions("sample", sample));
  sample.size = 0, sample.count = 10, sample.word = "b";
  EXPECT_NO_THROW(checkOptions("sample", sample));
}

TEST(Options, ValuesOutOfTheirLimitsAreNamed) {
  const auto refusal = [](const auto& change) {
    Sample sample;
    change(sample);
    return refusalOf([&] { checkOptions("sample", sample); });
  };
  EXPECT_EQ(refusal([](Sample& s) { s.size = 1.5; }),
            "sample.size must be between 0 and 1, got 1.5");
  EXPECT_EQ(refusal([](Sample& s) { s.size = std::numeric_limits<double>::quiet_NaN(); }),
            "sample.size must be between 0 and 1, got nan");
  EXPECT_EQ(refusal([](Sample& s) { s.count = 0; }),
            "sample.count must be between 1 and 10, got 0");
  EXPECT_EQ(refusal([](Sample& s) { s.word = "c"; }), "sample.word must be one of a, b, got 'c'");
}

TEST(Options, EvenWindowsAndPairsTheWrongWayRoundAreNamed) {
  SplitOptions split;
  split.window = 6;
  EXPECT_EQ(refusalOf([&] { checkOptions("split", split); }), "split.window must be odd, got 6");
  split.window = 33;
  EXPECT_EQ(refusalOf([&] { checkOptions("split", split); }),
            "split.window must be between 3 and 31, got 33");
  TableOptions table;
  table.min_height = table.max_height;
  EXPECT_EQ(refusalOf([&] { checkOptions("table", table); }),
            "table.min_height must be below table.max_height, got 0.5 and 0.5");
  ClusterOptions cluster;
  cluster.min_points = 500, cluster.max_points = 400;
  EXPECT_EQ(refusalOf([&] { checkOptions("cluster", cluster); }),
            "cluster.min_points must be below cluster.max_points, got 500 and 400");
}

TEST(OptionsYaml, WhatIsNotNamedKeepsItsDefault) {
  const Sample sample = parsed("{count: 7, on: true}");
  EXPECT_EQ(sample.size, 0.5);
  EXPECT_EQ(sample.count, 7);
  EXPECT_TRUE(sample.on);
  EXPECT_EQ(sample.word, "a");
  EXPECT_EQ(parsed("\"count\": 4").count, 4);
  EXPECT_EQ(parsed("").count, 3);
  EXPECT_EQ(parsed("{}").count, 3);
}

TEST(OptionsYaml, MistakesAreNamed) {
  EXPECT_EQ(refusalOfYaml("sise: 1"),
            "no such option: sample.sise; there are size, count, on, word");
  EXPECT_EQ(refusalOfYaml("count: many"), "sample.count cannot be 'many': wrong type");
  EXPECT_EQ(refusalOfYaml("count: 2.5"), "sample.count cannot be '2.5': wrong type");
  EXPECT_EQ(refusalOfYaml("on: 3"), "sample.on cannot be '3': wrong type");
  EXPECT_EQ(refusalOfYaml("size: [0.1, 0.2]"), "sample.size cannot be '[0.1, 0.2]': wrong type");
  EXPECT_EQ(refusalOfYaml("size: 2"), "sample.size must be between 0 and 1, got 2");
  EXPECT_EQ(refusalOfYaml("size: .nan"), "sample.size must be between 0 and 1, got nan");
  EXPECT_EQ(refusalOfYaml("7"), "sample must hold options by name, got '7'");
}

TEST(PipelineOptions, AFileNamesWhatDiffers) {
  const YamlFile file("filter:\n  max_range: 1.5\ncluster:\nrefine: {method: point_to_point}\n");
  const PipelineOptions options = readPipelineOptions(file.path());
  EXPECT_EQ(options.filter.max_range, 1.5);
  EXPECT_EQ(options.refine.method, "point_to_point");
  EXPECT_EQ(options.filter.min_range, FilterOptions().min_range);
  EXPECT_EQ(options.cluster.tolerance, ClusterOptions().tolerance);
}

TEST(PipelineOptions, AnEmptyFileChangesNothing) {
  for (const char* text : {"", "# nothing\n"})
    expectSame(readPipelineOptions(YamlFile(text).path()), PipelineOptions());
}

TEST(PipelineOptions, MistakesInAFileAreOneLineThatNamesIt) {
  EXPECT_EQ(
      refusalOfFile("filtre: {}").find(": no such option: options.filtre; there are depth_image, "),
      0u);
  EXPECT_EQ(refusalOfFile("cluster:\n  tolerence: 0.01"),
            ": no such option: cluster.tolerence; there are tolerance, noise_gap, min_points, "
            "max_points");
  EXPECT_EQ(refusalOfFile("cluster:\n  tolerance: 5"),
            ": cluster.tolerance must be between 0.001 and 0.2, got 5");
  EXPECT_EQ(refusalOfFile("cluster:\n  tolerance: wide"),
            ": cluster.tolerance cannot be 'wide': wrong type");
  EXPECT_EQ(refusalOfFile("cluster: 0.01"), ": cluster must hold options by name, got '0.01'");
  EXPECT_EQ(refusalOfFile("0.01"), ": options must hold options by name, got '0.01'");
  EXPECT_NE(refusalOfFile("cluster:\n  tolerance:\n    - 1\n    - 2\n").find("cluster.tolerance"),
            std::string::npos);
  EXPECT_NE(refusalOfFile("- filter\n- table\n"), "was not refused");
  EXPECT_NE(refusalOfFile("cluster: [1, 2]").find("cluster"), std::string::npos);
  EXPECT_NE(refusalOfFile("cluster:\n  [1]: 2\n").find("no such option: cluster.[1]"),
            std::string::npos);
  EXPECT_NE(refusalOfFile("cluster: {tolerance: 0.01"), "");
  EXPECT_NE(refusalOf([] {
              readPipelineOptions("/nowhere/options.yaml");
            }).find("/nowhere/options.yaml: "),
            std::string::npos);
}

TEST(PipelineOptions, TheShippedFileHoldsEveryDefault) {
  const std::string file = PROJECT_DIR "/config/default.yaml";
  expectSame(readPipelineOptions(file), PipelineOptions());
  const YAML::Node yaml = YAML::LoadFile(file);
  PipelineOptions options;
  options.visitStages([&](const std::string& section, auto& stage) {
    stage.visitFields([&](const std::string& name, auto&, const auto&...) {
      EXPECT_TRUE(yaml[section][name]) << section << '.' << name << " is missing";
    });
  });
}

TEST(PipelineOptions, DefaultsLieWithinTheirLimits) {
  PipelineOptions options;
  options.visitStages([](const std::string& section, auto& stage) {
    EXPECT_NO_THROW(checkOptions(section, stage)) << section;
  });
}
