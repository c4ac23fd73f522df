#pragma once

#include <cstdint>
#include <vector>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct ClusterOptions {
  double tolerance = 0.015;  ///< largest gap between two points of one object [m]
  double noise_gap = 0.006;  ///< organised: farther away at least this times the squared range, as
                             ///< the noise of depth grows so; 0: `tolerance` everywhere [1/m]
  int min_points = 300;      ///< smaller clusters are dropped
  int max_points = 200000;   ///< larger clusters are dropped

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("tolerance", tolerance, Range{0.001, 0.2});
    visit("noise_gap", noise_gap, Range{0, 0.1});
    visit("min_points", min_points, Range{1, 1e6});
    visit("max_points", max_points, Range{1, 1e7});
  }

  std::vector<Order> order() const {
    return {{"min_points", static_cast<double>(min_points), "max_points",
             static_cast<double>(max_points)}};
  }
};

/// Splits a cloud into groups of points no farther apart than `tolerance` (single linkage), largest
/// first (then by first index). Organised clouds by connected components over the grid, whose
/// pieces are then compared in space; unorganised ones by small cubes that are compared with those
/// around. Of an organised cloud the gap grows with the noise: that of triangulated depth is
/// about 0.0015 r^2 [m] at range r [m] (Khoshelham & Elberink 2012). Points that are not finite
/// belong to no cluster; an empty cloud has none.
std::vector<Indices> extractClusters(const Cloud& cloud, const ClusterOptions& options);

/// The same of some of a cloud's points alone: finite ones, ascending.
std::vector<Indices> extractClusters(const Cloud& cloud, const Indices& among,
                                     const ClusterOptions& options);

/// Labels as `segment` writes them and nodelets pass them: 0 nothing or invalid, 1 table, cluster i
/// has i + 2. As many as points in the cloud.
std::vector<std::uint32_t> labelsOf(std::size_t cloud_size, const Indices& table,
                                    const std::vector<Indices>& clusters);

/// The clusters behind such labels: entry i holds the points of label i + 2, perhaps none.
std::vector<Indices> clustersOf(const std::vector<std::uint32_t>& labels);

}  // namespace tabletop_perception
