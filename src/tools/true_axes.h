#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

namespace tabletop_perception::tools {

/// What the axes of a frame on a thing should be, whoever looks for them: found by trying all
/// planes, with none of the functions that a pick uses.
struct TrueAxes {
  /// Normals of the planes that hold `MIN_SHARE` of the points within `DISTANCE`; none where none
  /// does. The first holds most; another counts beside it only if it is as good: it faces elsewhere
  /// and holds nearly as many.
  std::vector<Eigen::Vector3d> z;
  /// Along the longer side of the least rectangle about the first plane's points, where the sides
  /// differ by MIN_ELONGATION.
  std::optional<Eigen::Vector3d> x;

  static constexpr double DISTANCE = 0.005;  ///< of a plane's points [m]
  static constexpr double MIN_SHARE = 0.4;
  static constexpr double MIN_ELONGATION = 1.5;
};

TrueAxes trueAxesOf(const std::vector<Eigen::Vector3f>& points);

}  // namespace tabletop_perception::tools
