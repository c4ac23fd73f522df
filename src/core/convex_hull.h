#pragma once

#include <vector>

#include <Eigen/Core>

namespace tabletop_perception {

/// The convex hull of points in a plane, counter-clockwise; empty when they lie on one line.
std::vector<Eigen::Vector2d> convexHullOf(const std::vector<Eigen::Vector2f>& points);

/// Centre of a polygon's area.
Eigen::Vector2d centroidOfPolygon(const std::vector<Eigen::Vector2d>& polygon);

/// Tells fast which points lie in a convex polygon: its extent in x is tabulated over slices of y.
/// Right to within a slice (2 mm, or a 4096th of the polygon).
class ConvexRegion {
 public:
  /// The polygon, its sides moved outwards by `margin` [m] (inwards if negative).
  ConvexRegion(const std::vector<Eigen::Vector2d>& polygon, double margin);

  bool contains(float x, float y) const {
    const float slice = (y - low_) * slices_per_metre_;
    if (!(slice >= 0 && slice < static_cast<float>(slices_.size()))) return false;
    const Slice& s = slices_[static_cast<std::size_t>(slice)];
    return x >= s.from && x <= s.to;
  }

 private:
  struct Slice {
    float from, to;
  };
  std::vector<Slice> slices_;
  float low_ = 0;
  float slices_per_metre_ = 0;
};

}  // namespace tabletop_perception
