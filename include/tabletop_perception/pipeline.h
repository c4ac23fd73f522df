#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/cluster.h"
#include "tabletop_perception/color.h"
#include "tabletop_perception/decide.h"
#include "tabletop_perception/depth_image.h"
#include "tabletop_perception/filter.h"
#include "tabletop_perception/grasp.h"
#include "tabletop_perception/match.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/pick.h"
#include "tabletop_perception/proposal_memory.h"
#include "tabletop_perception/refine.h"
#include "tabletop_perception/split.h"
#include "tabletop_perception/table.h"
#include "tabletop_perception/tracker.h"
#include "tabletop_perception/verify.h"

namespace tabletop_perception {

/// The options of every stage, in the order of the pipeline.
struct PipelineOptions {
  DepthImageOptions depth_image;  ///< of the nodelet: what comes to these functions is a cloud
  FilterOptions filter;
  TableOptions table;
  ClusterOptions cluster;
  SplitOptions split;
  ColorOptions color;
  MatchOptions match;
  RefineOptions refine;
  VerifyOptions verify;
  PickOptions pick;
  GraspOptions grasp;
  TrackerOptions track;

  /// Calls visit(section, options) for each stage.
  template <typename Visitor>
  void visitStages(Visitor&& visit) {
    visit("depth_image", depth_image);
    visit("filter", filter);
    visit("table", table);
    visit("cluster", cluster);
    visit("split", split);
    visit("color", color);
    visit("match", match);
    visit("refine", refine);
    visit("verify", verify);
    visit("pick", pick);
    visit("grasp", grasp);
    visit("track", track);
  }
};

/// Reads a yaml file with a section per stage; what it does not name keeps its default. Throws
/// std::invalid_argument for an unreadable file, unknown sections and keys, and bad values.
PipelineOptions readPipelineOptions(const std::string& yaml_file);

/// The table and what stands on it, before any recognition.
struct Segmentation {
  Cloud filtered;              ///< the cloud that the labels belong to
  std::optional<Table> table;  ///< the main one
  std::vector<Table> other_tables;
  std::vector<Indices> clusters;           ///< points of `filtered`, largest first
  std::string reason;                      ///< why there is no table or nothing on it
  std::map<std::string, double> times_ms;  ///< per stage, and "total"

  std::vector<std::uint32_t> labels() const;  ///< one per point of `filtered`
  std::vector<Table> tables() const;          ///< all, the main one first
};

/// Segmentation and an object for each cluster, in the order of the clusters.
struct Recognition {
  Segmentation segmentation;
  std::vector<SceneObject> objects;
  std::map<std::string, double> times_ms;  ///< per stage, and "total"
};

/// Filter, table, clusters. `up`: unit direction against gravity in the cloud's frame, if known.
Segmentation segmentScene(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                          const PipelineOptions& options);

/// The generous half of recognition: every cluster, and every union of clusters that touch, matched
/// against the database. `scene`: the cloud that the clusters' points belong to.
std::vector<Proposal> proposeObjects(const Cloud& scene, const std::vector<Indices>& clusters,
                                     const std::vector<Table>& tables, const ModelIndex& index,
                                     const MatchOptions& options);

/// The same; clusters that stay as they were in the frame before keep their candidates for
/// `options.keep`. `stamp`: time of the frame [s]. The memory must have been filled with the same
/// index and options.
std::vector<Proposal> proposeObjects(const Cloud& scene, const std::vector<Indices>& clusters,
                                     const std::vector<Table>& tables, const ModelIndex& index,
                                     const MatchOptions& options, double stamp,
                                     ProposalMemory& memory);

/// The whole pipeline in one call.
Recognition recognizeScene(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                           const ModelIndex& index, const PipelineOptions& options);

}  // namespace tabletop_perception
