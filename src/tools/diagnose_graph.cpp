#include "findings.h"

/// The graph's nodelets, and what they answer.
namespace tabletop_perception::tools {
namespace {

constexpr int FEW = 5;               ///< clouds of which one should have been answered
constexpr double MIN_ANSWERS = 0.1;  ///< answers per cloud

/// Whether the stages of this graph run.
bool checkStages(const GraphSeen& graph, Findings& findings) {
  std::vector<std::string> missing;
  for (const auto& [topic, advertised] : graph.stages)
    if (!advertised) missing.push_back(topic);
  if (missing.empty()) return true;

  if (missing.size() == graph.stages.size())
    findings.error("graph_missing",
                   "no nodelet runs in " + graph.ns + ": start perception.launch" +
                       (graph.other_ns.empty()
                            ? std::string()
                            : ", or look at what runs with --namespace " + graph.other_ns.front()));
  else
    findings.error("stage_missing",
                   "nobody advertises " + listOf(missing) +
                       ": the nodelets of these names died or refused their parameters (\"is not "
                       "started\" in the log says why); start them again");
  return false;
}

void checkDatabase(const GraphSeen& graph, Findings& findings) {
  if (!graph.database) return;
  const auto& database = *graph.database;
  // Where the nodelets run on another machine, theirs is the file that counts.
  const bool read = graph.candidates > 0 &&
                    graph.candidates_reason.find("database") == graph.candidates_reason.npos;
  const std::string name = "database " + database.file;
  const std::string train =
      ": `tabletop train --database FILE` adds objects, the launch argument "
      "database names the file";
  if (!database.exists) {
    if (!read) findings.error("database_missing", name + " does not exist" + train);
  } else if (!database.error.empty()) {
    const bool version = database.error.find("schema version") != database.error.npos;
    findings.error(version ? "database_version" : "database_unreadable",
                   "database " + database.error);
  } else if (database.objects == 0) {
    findings.error("database_empty", name + " holds 0 objects, must have at least one" + train);
  }
}

/// The first part of the graph that takes frames and gives none.
void checkSilence(const Observed& seen, Findings& findings) {
  if (findings.any({"node_unreachable", "stage_missing", "graph_missing", "cloud_fields",
                    "cloud_unreadable", "stamp_not_increasing", "stamp_zero"}))
    return;
  const auto& graph = *seen.graph;
  const int tables = seen.tables ? seen.tables->frames : 0;
  const auto silent = [&](const std::string& stages, const std::string& topic, int frames) {
    findings.error("stage_silent", graph.ns + "/" + topic + " sent nothing in " +
                                       figure(seen.seconds) + " s, but " + std::to_string(frames) +
                                       " frames went in before: " + stages +
                                       " hangs or is far too slow; look at its log and its CPU");
  };
  const int clouds = static_cast<int>(seen.clouds.size());
  if (clouds >= FEW && tables == 0)
    silent("filter or table", "table/tables", clouds);
  else if (tables >= FEW && graph.candidates == 0)
    silent("cluster or match", "match/candidates", tables);
  else if (graph.candidates >= FEW && graph.objects == 0)
    silent("refine", "refine/objects", graph.candidates);
  else if (clouds >= 2 * FEW && graph.objects < MIN_ANSWERS * clouds)
    findings.warning("answers_slow", "refine answers " + std::to_string(graph.objects) + " of " +
                                         std::to_string(clouds) + " clouds in " +
                                         figure(seen.seconds) +
                                         " s, far below the camera's rate: crop in filter, lower "
                                         "match.max_candidates (docs/tuning.md)");
}

}  // namespace

void checkGraph(const Observed& seen, Findings& findings) {
  const auto& graph = *seen.graph;
  if (!graph.silent_nodes.empty())
    findings.error("node_unreachable",
                   "registered with the master, but not answering: " + listOf(graph.silent_nodes) +
                       "; killed or hanging (`rosnode cleanup` forgets dead ones), or on a machine "
                       "whose ROS_IP or ROS_HOSTNAME cannot be reached from here");
  if (!checkStages(graph, findings)) return;

  if (graph.up_frame.empty() && !graph.up_stated)
    findings.hint("up_unknown",
                  graph.ns +
                      "/table has neither up_frame nor up nor pitch: give one, or a floor "
                      "or a wall may be taken for the table");
  checkDatabase(graph, findings);
  checkSilence(seen, findings);
}

void checkAnswers(const Observed& seen, Findings& findings) {
  if (!seen.tables || seen.tables->frames == 0) return;
  const auto& tables = *seen.tables;
  if (tables.reason.empty() ||
      findings.any({"cloud_fields", "cloud_unreadable", "cloud_empty", "cloud_all_nan",
                    "depth_millimetres", "depth_too_small", "table_behind_crop",
                    "table_before_crop"}))
    return;
  const bool up_missing = tables.reason.rfind("no up direction", 0) == 0;
  if (up_missing &&
      findings.any({"tf_missing", "frame_unknown", "up_frame_unknown", "tf_disconnected", "tf_past",
                    "tf_future", "frame_slash", "frame_empty", "stamp_zero", "stamp_future",
                    "clock_without_sim_time", "sim_time_without_clock"}))
    return;
  const std::string last = "in the last of " + std::to_string(tables.frames) + " frames: ";
  if (tables.reason == "nothing stands on it")
    findings.warning("nothing_on_table",
                     "nothing stands on the table " + last +
                         "is a thing flatter than table.min_height, or beyond its hull?");
  else if (2 * tables.found < tables.frames)
    findings.error("no_table", "no table " + last + tables.reason + " (docs/tuning.md)");
}

}  // namespace tabletop_perception::tools
