#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/match.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/refine.h"
#include "tabletop_perception/table.h"
#include "tabletop_perception/uncertainty.h"
#include "tabletop_perception/verify.h"

namespace tabletop_perception {

/// Something that stands on the table.
struct SceneObject {
  std::vector<std::uint32_t> labels;  ///< of the clusters that show it in the segmentation
  std::string name = "unknown";       ///< of the object in the database
  double score = 0;                   ///< probability of being right, 0 to 1
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();  ///< unknown: its box's pose
  PoseUncertainty uncertainty;                                        ///< of a known object's pose
  double fitness = 0;                   ///< RMS distance of the explained points [m]
  double visible = 0;                   ///< share of the model's surface that was seen, 0 to 1
  int points = 0;                       ///< of the cloud
  Evidence evidence;                    ///< that its score follows from; of a known object
  Box box;                              ///< about its points
  std::string reason;                   ///< why it is unknown
  std::optional<std::size_t> followed;  ///< index of the expected object that it still is
};

/// Some clusters of a scene that may be one thing, and what it may be.
struct Proposal {
  std::vector<std::uint32_t> labels;  ///< of the clusters in the segmentation, ascending
  Found<std::vector<Candidate>> candidates;
};

/// A cluster before anything is known of it: its points and the box about them.
SceneObject unknownObject(const Cloud& scene, const Indices& cluster, std::uint32_t label,
                          const std::optional<Table>& table);

/// The points of a cluster sampled as the database's views were.
Surface sampleCluster(const Cloud& scene, const Indices& cluster, const DescriptorOptions& options);

/// The strict half of recognition. Every candidate is refined and verified; of those that stand up
/// to the limits the ones are kept that explain most points best, no point twice. What an object
/// leaves over of its clusters is matched once more, for a cluster may hold several things. A
/// cluster that nothing explains is "unknown", with its box and the reason. In the order of the
/// labels. `tables`: all, the main one first; each thing is verified against the one that it stands
/// on.
///
/// `expected`: named objects of the frame before, at the poses that they had. One that is still
/// there, as good as it was, is followed: ICP starts at that pose, and its turn, its lead over
/// others and the fit that they were decided by stay as they are. What they explain is not decided
/// anew.
std::vector<SceneObject> decideObjects(const Cloud& scene, const std::vector<Indices>& clusters,
                                       const std::vector<Proposal>& proposals,
                                       const std::vector<Table>& tables, const ModelIndex& index,
                                       const MatchOptions& match, const RefineOptions& refine,
                                       const VerifyOptions& verify,
                                       const std::vector<SceneObject>& expected = {});

}  // namespace tabletop_perception
