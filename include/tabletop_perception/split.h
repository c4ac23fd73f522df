#pragma once

#include <vector>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

/// Where clusters of things that touch are cut apart.
struct SplitOptions {
  bool enabled = true;            ///< false: clusters stay as they are
  double spacing_deg = 0.22;      ///< angle between the pixels that are looked at: every second one
                                  ///< of a VGA camera with f 525, each one of a coarser [deg]
  int window = 7;                 ///< side of the window of a normal, in steps (odd)
  double gap = 0.015;             ///< neighbouring points farther apart do not touch [m]
  double smooth_angle_deg = 9;    ///< normals of neighbours in one smooth patch differ less [deg]
  double max_curvature = 0.04;    ///< points on sharper edges start no patch; 0 flat to 1/3
  int min_patch_points = 60;      ///< smaller patches are absorbed by their neighbours
  double concave_angle_deg = 12;  ///< patches that meet in a sharper hollow are not one thing [deg]
  int min_points = 300;           ///< smaller parts join the neighbour with the longest border, or
                                  ///< are dropped where they touch nothing

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("enabled", enabled);
    visit("spacing_deg", spacing_deg, Range{0.01, 2});
    visit("window", window, OddRange{{3, 31}});
    visit("gap", gap, Range{0.001, 0.2});
    visit("smooth_angle_deg", smooth_angle_deg, Range{0.1, 90});
    visit("max_curvature", max_curvature, Range{0, 0.34});
    visit("min_patch_points", min_patch_points, Range{1, 1e6});
    visit("concave_angle_deg", concave_angle_deg, Range{0.1, 90});
    visit("min_points", min_points, Range{1, 1e6});
  }
};

/// Cuts clusters where their surface has a hollow: convex things that touch or stand on each other
/// meet in concave edges. Smooth patches of the grid are joined across convex edges, longest first,
/// as long as the whole border between two groups is more convex than not (after the local
/// convexity of Stein et al. 2014, on patches instead of supervoxels). Largest part first, each
/// with its points ascending. Of an unorganised cloud, or with `enabled` false, the clusters come
/// back as they are.
std::vector<Indices> splitClusters(const Cloud& cloud, const std::vector<Indices>& clusters,
                                   const SplitOptions& options);

}  // namespace tabletop_perception
