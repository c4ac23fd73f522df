#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <thread>

#include <geometry_msgs/PointStamped.h>
#include <nodelet/loader.h>
#include <ros/master.h>
#include <tabletop_perception/CaptureView.h>

#include "graph.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {
namespace {

using namespace test;

const std::set<std::string> NODELETS = {"openni2", "compress", "depth_image", "filter",
                                        "table",   "cluster",  "match",       "refine",
                                        "markers", "pick",     "capture"};
const std::set<std::string> WITH_DATABASE = {"match", "refine", "markers", "pick", "capture"};
const std::filesystem::path PROJECT(PROJECT_DIR);

std::string textOf(const std::filesystem::path& file) {
  std::ifstream in(file);
  EXPECT_TRUE(in) << file;
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// All that a pattern finds in a text: its group.
std::set<std::string> allIn(const std::string& text, const std::string& pattern, int group = 1) {
  std::set<std::string> found;
  const std::regex regex(pattern);
  for (std::sregex_iterator i(text.begin(), text.end(), regex), end; i != end; ++i)
    found.insert((*i)[group].str());
  return found;
}

std::vector<std::filesystem::path> pages() {
  std::vector<std::filesystem::path> files = {PROJECT / "README.md"};
  for (const auto& entry : std::filesystem::directory_iterator(PROJECT / "docs"))
    if (entry.path().extension() == ".md") files.push_back(entry.path());
  return files;
}

/// Topics and services of a nodelet by their names after "~", with their types where they are
/// known.
using Names = std::map<std::string, std::string>;

/// What the page of a nodelet names in its tables: `~name`, in the third column its type.
Names documented(const std::string& nodelet) {
  std::istringstream page(textOf(PROJECT / "docs" / (nodelet + ".md")));
  const std::regex name("`~([a-zA-Z_/]+)`"),
      typed("\\| (in|out|service) \\| `~[a-zA-Z_/]+` \\| ([\\w/]+) \\|.*");
  Names names;
  for (std::string line; std::getline(page, line);) {
    if (line.empty() || line[0] != '|') continue;
    std::smatch row;
    const std::string type = std::regex_match(line, row, typed) ? row[2].str() : "";
    for (std::sregex_iterator i(line.begin(), line.end(), name), end; i != end; ++i)
      names[(*i)[1].str()] = type;
  }
  return names;
}

/// What the graph's master knows of each nodelet, without what dynamic_reconfigure adds.
std::map<std::string, Names> running() {
  const std::set<std::string> common = {"parameter_descriptions", "parameter_updates",
                                        "set_parameters"};
  XmlRpc::XmlRpcValue request, state, types, payload;
  request[0] = ros::this_node::getName();
  std::map<std::string, std::string> type_of;
  if (ros::master::execute("getTopicTypes", request, types, payload, false))
    for (int i = 0; i < payload.size(); ++i) type_of[payload[i][0]] = std::string(payload[i][1]);
  std::map<std::string, Names> found;
  if (!ros::master::execute("getSystemState", request, state, payload, false)) return found;
  for (int kind = 0; kind < payload.size(); ++kind)  // publishers, subscribers, services
    for (int i = 0; i < payload[kind].size(); ++i) {
      const std::string whole = payload[kind][i][0];
      const auto slash = whole.find('/', 1);
      if (slash == std::string::npos) continue;
      const std::string nodelet = whole.substr(1, slash - 1), name = whole.substr(slash + 1);
      if (NODELETS.count(nodelet) && !common.count(name)) found[nodelet][name] = type_of[whole];
    }
  return found;
}

/// Listens to a topic of any type.
ros::Subscriber listenTo(ros::NodeHandle& nh, const std::string& topic) {
  ros::SubscribeOptions options;
  options.init<std_msgs::Header>(topic, 1, [](const auto&) {});
  options.md5sum = options.datatype = "*";
  return nh.subscribe(options);
}

std::set<std::string> namesOf(const Names& names) {
  std::set<std::string> set;
  for (const auto& [name, type] : names) set.insert(name);
  return set;
}

/// The first cells of the tables under "## Parameters".
std::set<std::string> documentedParameters(const std::string& nodelet) {
  std::istringstream page(textOf(PROJECT / "docs" / (nodelet + ".md")));
  std::set<std::string> names;
  bool inside = false;
  for (std::string line; std::getline(page, line);) {
    if (line.rfind("## ", 0) == 0) inside = line == "## Parameters";
    if (inside && line.rfind("| `", 0) == 0)
      names.merge(allIn(line.substr(0, line.find('|', 1)), "`([a-z_]+)`"));
  }
  return names;
}

/// The parameters of a nodelet without the options that default.yaml names, as it lists them when
/// it refuses one.
std::set<std::string> actualParameters(ros::NodeHandle& nh, nodelet::Loader& manager,
                                       const LogRecorder& log, const std::string& nodelet) {
  const std::string name = "/refusing_" + nodelet;
  nh.setParam(name + "/no_such_thing", 1);
  EXPECT_TRUE(manager.load(name, "tabletop_perception/" + nodelet, {}, {}));
  EXPECT_TRUE(spinUntil([&] { return log.has(name + "/no_such_thing"); }, 5)) << nodelet;
  std::set<std::string> names;
  for (const auto& text : log.texts()) {
    const auto list = text.find("; there are ");
    if (list != text.npos && text.find(name + "/no_such_thing") != text.npos)
      names = allIn(text.substr(list + 11), "(\\w+)");
  }
  names.erase("diagnostic_period");  // of all: docs/diagnostics.md
  PipelineOptions().visitStages([&](const std::string& section, auto& stage) {
    if (section == nodelet)
      stage.visitFields([&](const std::string& field, const auto&...) { names.erase(field); });
  });
  return names;
}

TEST(Docs, everyParameterIsDocumentedAndThere) {
  ros::NodeHandle nh;
  const LogRecorder log(nh);
  nodelet::Loader manager(false);
  for (const auto& nodelet : NODELETS)
    EXPECT_EQ(documentedParameters(nodelet), actualParameters(nh, manager, log, nodelet))
        << "docs/" << nodelet << ".md, and the nodelet";
}

TEST(Docs, everyLaunchArgumentExistsAndSaysWhatItIs) {
  std::map<std::string, std::set<std::string>> args_of;
  std::set<std::string> all;
  for (const auto& entry : std::filesystem::directory_iterator(PROJECT / "launch")) {
    const std::string launch = textOf(entry.path());
    const auto open = allIn(launch, "\n  <arg name=\"(\\w+)\"(?! value)");
    EXPECT_EQ(open, allIn(launch, "\n  <arg name=\"(\\w+)\"(?! value)[^>]* doc=\"[^\"]+\"/>"))
        << entry.path() << ", and its arguments with a doc";
    args_of[entry.path().filename()] = open;
    all.insert(open.begin(), open.end());
  }
  for (const auto& page : pages()) {
    const std::string text = std::regex_replace(textOf(page), std::regex("\\\\\n *"), " ");
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      const auto used = allIn(line, "[ `(]([a-z]\\w*):=");
      const auto file = allIn(line, "roslaunch [^`]*tabletop_perception (\\w+\\.launch)");
      for (const auto& arg : used)
        EXPECT_TRUE((file.size() == 1 ? args_of[*file.begin()] : all).count(arg))
            << page << " has " << arg << ":= in: " << line;
    }
  }
}

TEST(Docs, everyTopicAndServiceIsDocumentedAndThere) {
  ros::NodeHandle nh;
  for (const auto& name : WITH_DATABASE)
    nh.setParam("/" + name + "/database", "/nowhere/objects.db");
  nodelet::Loader manager(false);
  for (const auto& name : NODELETS)
    ASSERT_TRUE(manager.load("/" + name, "tabletop_perception/" + name, {}, {})) << name;
  std::vector<ros::Subscriber> listeners;  // a nodelet that nobody listens to has no inputs
  for (const auto& [nodelet, names] : running())
    for (const auto& [name, type] : names)
      listeners.push_back(listenTo(nh, "/" + nodelet + "/" + name));
  const auto clicks = nh.advertise<geometry_msgs::PointStamped>("/clicked_point", 1);
  std::thread teacher([] {  // capture listens while a call waits
    CaptureView call;
    call.request.name = "thing";
    call.request.timeout = ros::Duration(30);
    ros::service::call("/capture/capture_view", call);
  });

  for (const auto& nodelet : NODELETS) {
    const Names page = documented(nodelet);
    Names graph;
    spinUntil([&] {
      clicks.publish(geometry_msgs::PointStamped());  // pick listens while a click waits
      const auto isAsDocumented = [&] {
        graph = running()[nodelet];
        return namesOf(graph) == namesOf(page);
      };
      return spinUntil(isAsDocumented, 0.5);
    });
    EXPECT_EQ(namesOf(page), namesOf(graph)) << "docs/" << nodelet << ".md, and the graph";
    for (const auto& [name, type] : page) {
      const auto there = graph.find(name);
      if (type.empty() || there == graph.end() || there->second.empty()) continue;
      EXPECT_EQ(type, there->second) << nodelet << "/" << name;
    }
  }
  for (const auto& topic :
       allIn(textOf(PROJECT / "rviz/perception.rviz"), "Topic: /perception/(\\S+)")) {
    const auto slash = topic.find('/');
    EXPECT_TRUE(running()[topic.substr(0, slash)].count(topic.substr(slash + 1)))
        << "rviz/perception.rviz shows /perception/" << topic;
  }
  PipelineOptions().visitStages([&](const std::string& section, auto& stage) {
    stage.visitFields([&](const std::string& field, const auto&...) {
      EXPECT_TRUE(nh.hasParam("/" + section + "/" + field))
          << "config/default.yaml names " << section << "." << field << ", no nodelet serves it";
    });
  });
  ros::shutdown();  // ends the call, and all tests that need a graph
  teacher.join();
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "docs_test");
  return RUN_ALL_TESTS();
}
