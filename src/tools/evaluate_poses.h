#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/bop_metrics.h"
#include "tabletop_perception/pose_metrics.h"
#include "tabletop_perception/tracker.h"
#include "tabletop_perception/verify.h"
#include "true_poses.h"

/// What the figures of poses and their report share.
namespace tabletop_perception::tools {

/// What a result gives a name.
struct NamedResult : PosedObject {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();    ///< of its points, else of its frame [m]
  std::optional<double> score;                         ///< where the result says it
  std::optional<Evidence> evidence;                    ///< likewise
  PoseCovariance covariance = PoseCovariance::Zero();  ///< of the pose; zero where it is not said
};

/// A scene of the truth, and how its result came out.
struct PosedScene {
  std::string name;
  std::filesystem::path folder;
  std::vector<TrueObject> truth;    ///< of names that were taught
  std::vector<TrueObject> unknown;  ///< of names that were not
  bool has_result = false;
  std::vector<NamedResult> results;
  std::optional<double> time_ms;  ///< that the result took
  PoseScore score;

  /// Whether a result has the name and the pose of an object of the truth.
  bool right(std::size_t result) const {
    const auto& object = score.object_of_result[result];
    return object && score.truth[*object].right();
  }

  std::size_t false_accepts = 0;  ///< unknown objects that were given a name
  /// Of each object of `truth`; absent where there is no depth image.
  std::optional<std::vector<std::optional<BopRecall>>> bop;
  /// Height of each true object's lowest vertex above the table that was found [m]; of things that
  /// stand on it: how far the table is off. Empty without a table.
  std::vector<double> lowest;
};

/// What a set of scenes gives beyond the figures of its poses.
struct FurtherFigures {
  struct Bin {
    double from = 0, to = 0;  ///< of the visible share; the last holds its end too
    std::size_t objects = 0, right = 0;
  };
  std::optional<BopRecall> bop;  ///< over the scenes with a depth image
  std::size_t unknown = 0, false_accepts = 0;
  std::vector<Bin> visibility;  ///< empty where the truth does not say what is seen
  std::optional<double> mean_time_ms, max_time_ms;
};

FurtherFigures furtherFigures(const std::vector<PosedScene>& scenes);

/// As rows of a name and figures.
std::vector<std::vector<std::string>> furtherRows(const FurtherFigures& figures);

std::vector<PoseScore> scoresOf(const std::vector<PosedScene>& scenes);

/// A table's head, and a row of it: a name and figures.
std::vector<std::string> poseHeads();
std::vector<std::string> poseRow(const std::string& name, const PoseSummary& summary);

}  // namespace tabletop_perception::tools
