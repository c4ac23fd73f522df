#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <regex>
#include <string>

#include <yaml-cpp/yaml.h>

#include "marker_options.h"
#include "openni_options.h"
#include "options_ros.h"
#include "tabletop_perception/ClusterConfig.h"
#include "tabletop_perception/ColorConfig.h"
#include "tabletop_perception/DepthImageConfig.h"
#include "tabletop_perception/FilterConfig.h"
#include "tabletop_perception/GraspConfig.h"
#include "tabletop_perception/MarkersConfig.h"
#include "tabletop_perception/MatchConfig.h"
#include "tabletop_perception/OpenniConfig.h"
#include "tabletop_perception/PickConfig.h"
#include "tabletop_perception/RefineConfig.h"
#include "tabletop_perception/SplitConfig.h"
#include "tabletop_perception/TableConfig.h"
#include "tabletop_perception/TrackConfig.h"
#include "tabletop_perception/VerifyConfig.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {
namespace {

/// A field as a person reads it: default, least and largest value or words.
struct Field {
  std::string value, limits;
  bool operator==(const Field& other) const {
    return value == other.value && limits == other.limits;
  }
};
std::ostream& operator<<(std::ostream& out, const Field& f) {
  return out << f.value << " in " << f.limits;
}
using Fields = std::map<std::string, Field>;

std::string text(double number) {
  std::ostringstream out;
  out << number;
  return out.str();
}
std::string text(bool flag) { return flag ? "true" : "false"; }
std::string text(const std::string& word) { return word; }

std::string limitsText(const Range& range) { return text(range.min) + ".." + text(range.max); }
std::string limitsText(const Choices& choices) {
  std::string words;
  for (const auto& word : choices.words) words += word + " ";
  return words;
}
std::string limitsText(const WordList&) { return ""; }  // dynamic_reconfigure knows no such limit

template <typename Options>
Fields fieldsOf(Options options) {
  Fields fields;
  options.visitFields([&](const std::string& name, auto& value, const auto&... limits) {
    std::string all;
    ((all += limitsText(limits)), ...);
    if constexpr (std::is_same_v<std::decay_t<decltype(value)>, int>)
      fields[name] = {text(static_cast<double>(value)), all};
    else
      fields[name] = {text(value), all};
  });
  return fields;
}

/// The words in the description of an enumeration.
std::string wordsOf(const std::string& edit_method) {
  std::string words;
  const std::regex value("'value': '(\\w+)'");
  for (std::sregex_iterator i(edit_method.begin(), edit_method.end(), value), end; i != end; ++i)
    words += (*i)[1].str() + " ";
  return words;
}

template <typename Config>
Fields fieldsOfConfig() {
  const auto& description = Config::__getDescriptionMessage__();
  Fields fields;
  for (const auto& p : description.dflt.doubles) fields[p.name].value = text(p.value);
  for (const auto& p : description.min.doubles) fields[p.name].limits = text(p.value) + "..";
  for (const auto& p : description.max.doubles) fields[p.name].limits += text(p.value);
  for (const auto& p : description.dflt.ints)
    fields[p.name].value = text(static_cast<double>(p.value));
  for (const auto& p : description.min.ints)
    fields[p.name].limits = text(static_cast<double>(p.value)) + "..";
  for (const auto& p : description.max.ints)
    fields[p.name].limits += text(static_cast<double>(p.value));
  for (const auto& p : description.dflt.bools)
    fields[p.name].value = text(static_cast<bool>(p.value));
  for (const auto& p : description.dflt.strs) fields[p.name].value = p.value;
  for (const auto& group : description.groups)
    for (const auto& p : group.parameters)
      if (p.type == "str") fields[p.name].limits = wordsOf(p.edit_method);
  return fields;
}

template <typename Config, typename Options>
void expectSameFields() {
  const Fields config = fieldsOfConfig<Config>(), options = fieldsOf(Options());
  EXPECT_FALSE(options.empty());
  for (const auto& [name, field] : options) {
    ASSERT_TRUE(config.count(name)) << name << " is missing in the .cfg";
    EXPECT_EQ(config.at(name), field) << name;
  }
  for (const auto& [name, field] : config)
    EXPECT_TRUE(options.count(name)) << name << " is no option any more";
}

TEST(Config, depthImageHasTheOptionsOfItsStruct) {
  expectSameFields<DepthImageConfig, DepthImageOptions>();
}
TEST(Config, filterHasTheOptionsOfItsStruct) { expectSameFields<FilterConfig, FilterOptions>(); }
TEST(Config, tableHasTheOptionsOfItsStruct) { expectSameFields<TableConfig, TableOptions>(); }
TEST(Config, clusterHasTheOptionsOfItsStruct) { expectSameFields<ClusterConfig, ClusterOptions>(); }
TEST(Config, matchHasTheOptionsOfItsStruct) { expectSameFields<MatchConfig, MatchOptions>(); }
TEST(Config, refineHasTheOptionsOfItsStruct) { expectSameFields<RefineConfig, RefineOptions>(); }
TEST(Config, splitHasTheOptionsOfItsStruct) { expectSameFields<SplitConfig, SplitOptions>(); }
TEST(Config, colorHasTheOptionsOfItsStruct) { expectSameFields<ColorConfig, ColorOptions>(); }
TEST(Config, verifyHasTheOptionsOfItsStruct) { expectSameFields<VerifyConfig, VerifyOptions>(); }
TEST(Config, pickHasTheOptionsOfItsStruct) { expectSameFields<PickConfig, PickOptions>(); }
TEST(Config, graspHasTheOptionsOfItsStruct) { expectSameFields<GraspConfig, GraspOptions>(); }
TEST(Config, trackHasTheOptionsOfItsStruct) { expectSameFields<TrackConfig, TrackerOptions>(); }
TEST(Config, markersHaveTheOptionsOfTheirStruct) {
  expectSameFields<MarkersConfig, MarkerOptions>();
}

TEST(Config, openniHasTheOptionsOfItsStruct) { expectSameFields<OpenniConfig, OpenniOptions>(); }

/// The options of a stage outside all groups.
template <typename Config>
std::string ungrouped() {
  std::string names;
  for (const auto& group : Config::__getDescriptionMessage__().groups)
    if (group.name == "Default")
      for (const auto& p : group.parameters) names += p.name + " ";
  return names;
}

TEST(Config, allOptionsAreInGroups) {
  EXPECT_EQ(ungrouped<OpenniConfig>(), "");
  EXPECT_EQ(ungrouped<DepthImageConfig>(), "");
  EXPECT_EQ(ungrouped<FilterConfig>(), "");
  EXPECT_EQ(ungrouped<TableConfig>(), "");
  EXPECT_EQ(ungrouped<SplitConfig>(), "");
  EXPECT_EQ(ungrouped<ColorConfig>(), "");
  EXPECT_EQ(ungrouped<MatchConfig>(), "");
  EXPECT_EQ(ungrouped<RefineConfig>(), "");
  EXPECT_EQ(ungrouped<VerifyConfig>(), "");
  EXPECT_EQ(ungrouped<ClusterConfig>(), "");
  EXPECT_EQ(ungrouped<TrackConfig>(), "");
  EXPECT_EQ(ungrouped<PickConfig>(), "");
  EXPECT_EQ(ungrouped<GraspConfig>(), "");
  EXPECT_EQ(ungrouped<MarkersConfig>(), "");
}

TEST(Config, aConfigBecomesOptions) {
  FilterConfig config = FilterConfig::__getDefault__();
  config.max_range = 1.25;
  config.box = true;
  config.outliers = "radius";
  config.outlier_neighbors = 7;
  const auto options = optionsFromConfig<FilterOptions>(config);
  EXPECT_EQ(options.max_range, 1.25);
  EXPECT_TRUE(options.box);
  EXPECT_EQ(options.outliers, "radius");
  EXPECT_EQ(options.outlier_neighbors, 7);
}

TEST(Config, defaultYamlNamesEveryOptionWithItsDefault) {
  const auto file = std::filesystem::path(PROJECT_DIR) / "config/default.yaml";
  const YAML::Node yaml = YAML::LoadFile(file.string());
  PipelineOptions read = readPipelineOptions(file.string());
  std::map<std::string, Fields> from_yaml, from_structs;
  read.visitStages([&](const std::string& section, auto& stage) {
    from_yaml[section] = fieldsOf(stage);
    for (const auto& [name, field] : from_yaml[section])
      EXPECT_TRUE(yaml[section][name]) << section << "." << name << " is missing";
  });
  PipelineOptions().visitStages(
      [&](const std::string& section, auto& stage) { from_structs[section] = fieldsOf(stage); });
  EXPECT_EQ(from_yaml, from_structs);
}

TEST(Config, everyShippedYamlIsValid) {
  int files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(PROJECT_DIR) / "config")) {
    if (entry.path().extension() != ".yaml") continue;
    EXPECT_NO_THROW(readPipelineOptions(entry.path().string())) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 2);
}

}  // namespace
}  // namespace tabletop_perception
