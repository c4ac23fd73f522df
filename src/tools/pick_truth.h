#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "evaluate_labels.h"
#include "tabletop_perception/cloud.h"
#include "true_poses.h"

/// Scenes of which every pixel's object is known, and where to pick them.
namespace tabletop_perception::tools {

/// An object of the truth.
struct PickTarget {
  Indices points;                ///< with depth
  Indices inner;                 ///< of these, those some pixels from the border
  std::map<int, Indices> parts;  ///< by label: those that the truth tells apart
  std::vector<cv::Point> picks;  ///< the innermost pixel, and four half-way from it to the border
  std::optional<TrueObject> posed;  ///< where the truth says it
};

struct PickTruth {
  Cloud cloud;
  cv::Mat1i labels;  ///< of its pixels
  std::optional<Eigen::Vector3d> up;
  std::vector<PickTarget> targets;  ///< that have points

  /// Whether a target comes near another one.
  bool touching(const PickTarget& target) const;
};

/// Of a .pcd with labels.
PickTruth readPickTruth(const LabelledScene& scene);

/// Of a folder with gt.json and label.png; without the latter the objects' pixels are rendered from
/// their meshes at the poses of gt.json.
PickTruth readPickTruth(const std::filesystem::path& folder, const TrueModels& models);

/// The names in the gt.json of some folders.
std::set<std::string> objectsNamedIn(const std::vector<std::filesystem::path>& folders);

}  // namespace tabletop_perception::tools
