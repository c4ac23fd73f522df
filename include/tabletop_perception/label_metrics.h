#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace tabletop_perception {

/// The assignment of rows to columns, one to one, with the largest sum of scores (the Hungarian
/// method, O(n^3)). Per row its column, -1 for rows left over when there are fewer columns.
std::vector<int> bestAssignment(const Eigen::MatrixXd& scores);

/// Parts of the truth with fewer points are no objects.
constexpr std::size_t MIN_PART_POINTS = 300;

/// An object counts as found with an intersection over union of at least this.
constexpr double FOUND_IOU = 0.75;

/// How one object of the truth, or one part of it where its parts are read apart, came out.
struct ObjectOverlap {
  std::uint32_t object = 0;        ///< 1 for the truth's labels 20..29, 2 for 30..39 ...
  std::uint32_t part = 0;          ///< the truth's label of the part; 0: the object as a whole
  std::uint32_t segment = 0;       ///< matched label of the result; 0: none
  std::size_t points = 0;          ///< of the truth
  std::size_t segment_points = 0;  ///< of the matched segment
  std::size_t overlap = 0;         ///< points of both

  /// Intersection over union, 0 to 1.
  double iou() const;
};

/// A scene's overlap under one reading of the truth: which objects count as a whole and which in
/// parts.
struct OverlapScore {
  std::vector<ObjectOverlap> objects;
  std::size_t truth_points = 0;    ///< of all objects
  std::size_t segment_points = 0;  ///< of all segments, matched or not
  std::size_t overlap = 0;         ///< of all matched pairs

  /// overlap / segment_points, overlap / truth_points and their harmonic mean, 0 to 1. With nothing
  /// to divide by: 1 if there are neither objects nor segments, else 0.
  double precision() const;
  double recall() const;
  double f() const;
};

/// The overlap of a segmentation with the labelled truth of its scene, as the multi-object overlap
/// F of Xie et al. (Unseen Object Instance Segmentation for Robotic Environments, 2021) after Dave
/// et al. (Towards Segmenting Anything That Moves, 2019), counted in points of the cloud.
///
/// Truth: 0 no valid point, 1 to 9 table, 20 to 29 the parts of the first object, 30 to 39 of the
/// second and so on; parts of fewer than 300 points are no objects (but their points stay, and a
/// segment that holds them overlaps nothing there). Result: 0 nothing, 1 table, 2 and up one object
/// each. Points without a valid truth do not count at all. Objects and segments are matched one to
/// one with the largest sum of F = 2 |A and B| / (|A| + |B|).
struct LabelScore {
  /// Each object read as a whole or in parts, whichever gives the scene the larger overlap; as a
  /// whole where it is the same.
  OverlapScore best;
  OverlapScore whole;    ///< every object as a whole
  OverlapScore parts;    ///< every part an object
  double table_iou = 0;  ///< 0 to 1; 1 if neither has a table
};

/// Compares label by label; throws std::invalid_argument unless there are as many of both.
LabelScore scoreLabels(const std::vector<std::uint32_t>& truth,
                       const std::vector<std::uint32_t>& result);

/// Overlap over several scenes: the means of the scenes' figures (so `f` is not the harmonic mean
/// of the other two), and the objects of all scenes in one pool.
struct OverlapSummary {
  double precision = 0, recall = 0, f = 0;  ///< 0 to 1
  std::size_t objects = 0;                  ///< in the truth
  std::size_t found = 0;                    ///< matched with an IoU of at least 0.75

  /// found / objects; none without objects.
  std::optional<double> foundShare() const;
};

struct LabelSummary {
  std::size_t scenes = 0;
  OverlapSummary best, whole, parts;
  double table_iou = 0;        ///< mean over the scenes
  double worst_table_iou = 0;  ///< of all scenes
};

/// Throws std::invalid_argument if there are no scores.
LabelSummary summarize(const std::vector<LabelScore>& scores);

}  // namespace tabletop_perception
