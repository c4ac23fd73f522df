#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <thread>

#include <geometry_msgs/PointStamped.h>
#include <nodelet/loader.h>
#include <ros/master.h>
#include <tabletop_perception/CaptureView.h>

#include "graph.h"

namespace tabletop_perception {
namespace {

using namespace test;

const std::set<std::string> NODELETS = {"depth_image", "filter",  "table", "cluster", "match",
                                        "refine",      "markers", "pick",  "capture"};

/// Topics and services of a nodelet by their names after "~", with their types where they are
/// known.
using Names = std::map<std::string, std::string>;

/// What the page of a nodelet names in its tables: `~name`, in the third column its type.
Names documented(const std::string& nodelet) {
  std::ifstream page(std::string(PROJECT_DIR) + "/docs/" + nodelet + ".md");
  EXPECT_TRUE(page) << nodelet << " has no page";
  const std::regex name("`~([a-z_]+)`"),
      typed("\\| (in|out|service) \\| `~[a-z_]+` \\| ([\\w/]+) \\|.*");
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

TEST(Docs, everyTopicAndServiceIsDocumentedAndThere) {
  ros::NodeHandle nh;
  for (const auto& name : NODELETS) nh.setParam("/" + name + "/database", "/nowhere/objects.db");
  for (const std::string name : {"depth_image", "filter", "table", "cluster"})
    nh.deleteParam("/" + name + "/database");
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
    spinUntil([&] {
      clicks.publish(geometry_msgs::PointStamped());  // pick listens while a click waits
      return spinUntil([&] { return namesOf(running()[nodelet]) == namesOf(page); }, 0.5);
    });
    const Names graph = running()[nodelet];
    EXPECT_EQ(namesOf(page), namesOf(graph)) << "docs/" << nodelet << ".md, and the graph";
    for (const auto& [name, type] : page) {
      const auto there = graph.find(name);
      if (type.empty() || there == graph.end() || there->second.empty()) continue;
      EXPECT_EQ(type, there->second) << nodelet << "/" << name;
    }
  }
  ros::shutdown();  // ends the call
  teacher.join();
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "docs_test");
  return RUN_ALL_TESTS();
}
