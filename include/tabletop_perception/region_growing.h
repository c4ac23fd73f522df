#pragma once

#include <vector>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct RegionGrowingOptions {
  double smooth_angle_deg = 5;  ///< between the normals of neighbours in one region [deg]
  double max_curvature = 0.03;  ///< sharper points join regions but do not grow them; 0 flat to 1/3
  double gap = 0.015;           ///< neighbours are no farther apart [m]
  int min_points = 60;          ///< smaller regions are dropped
  int max_points = 1000000;     ///< larger regions are dropped

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("smooth_angle_deg", smooth_angle_deg, Range{0.1, 90});
    visit("max_curvature", max_curvature, Range{0, 0.34});
    visit("gap", gap, Range{0.001, 0.2});
    visit("min_points", min_points, Range{1, 1e7});
    visit("max_points", max_points, Range{1, 1e7});
  }
};

/// Smooth regions by growing (Rabbani et al. 2006, "Segmentation of point clouds using smoothness
/// constraint"): from the flattest point that is left, a region takes its neighbours whose normals
/// differ little, and grows on from those of them that are flat themselves. Neighbours are the
/// eight pixels around a point of an organised cloud, all points within `gap` in an unorganised
/// one. Largest first (then by first index), each with its points ascending. Points that are not
/// finite or have no normal belong to no region, as do points on edges that no region reaches.
/// `normals`: one per point with curvature, turned towards one viewpoint, as computeNormals gives
/// them; throws std::invalid_argument for another number of them.
std::vector<Indices> growRegions(const Cloud& cloud, const Normals& normals,
                                 const RegionGrowingOptions& options);

/// The same for the points of a surface. Their curvature, as far as `max_curvature` goes, is how
/// much the normals within `gap` cancel out: 0 where they are all alike.
std::vector<Indices> growRegions(const Surface& surface, const RegionGrowingOptions& options);

}  // namespace tabletop_perception
