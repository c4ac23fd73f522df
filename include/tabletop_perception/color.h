#pragma once

#include <vector>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

/// What the color of clusters decides.
struct ColorOptions {
  bool enabled = false;         ///< false: color decides nothing, whatever follows
  bool merge = true;            ///< join clusters that one color covers
  bool split = false;           ///< cut clusters of several colors apart
  double max_hue_deg = 20;      ///< hues in one color differ less from their mean [deg]
  double max_saturation = 0.3;  ///< saturations in one color differ less from their mean, 0 to 1
  double min_saturation = 0.3;  ///< less saturated points are grey and have no color, 0 to 1
  double min_value = 0.15;      ///< darker points are grey too, 0 to 1
  double max_gap = 0.15;        ///< neighbours farther apart are never of one color [m]
  double min_cover = 0.7;       ///< merge: least share that the color covers of each cluster
  int min_points = 300;         ///< smaller patches of a color are dropped

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("enabled", enabled);
    visit("merge", merge);
    visit("split", split);
    visit("max_hue_deg", max_hue_deg, Range{1, 180});
    visit("max_saturation", max_saturation, Range{0.01, 1});
    visit("min_saturation", min_saturation, Range{0.01, 1});
    visit("min_value", min_value, Range{0, 1});
    visit("max_gap", max_gap, Range{0.001, 2});
    visit("min_cover", min_cover, Range{0.1, 1});
    visit("min_points", min_points, Range{1, 1e6});
  }
};

/// Connected pixels of the clusters whose hue and saturation are those of the whole patch: each
/// pixel is compared with the running mean of the patch beside it, brightness is left out. Grey has
/// no hue and belongs to no patch. Pixels beside a step in depth may be mixed with the background:
/// they join patches but start none. Largest first, points ascending. None without color or grid.
std::vector<Indices> colorClusters(const Cloud& cloud, const std::vector<Indices>& clusters,
                                   const ColorOptions& options);

/// Joins clusters that one color cluster covers to a sufficient share each, such as the front and
/// the back of a bowl, which are apart in depth. Largest first; clusters come back as they are
/// where nothing is joined, without color or grid, and with the switch off.
std::vector<Indices> mergeByColor(const Cloud& cloud, const std::vector<Indices>& clusters,
                                  const ColorOptions& options);

/// Divides each cluster that holds the centres of several color clusters: these grow evenly over
/// its pixels until they meet; what they do not reach goes to the largest. Largest first; clusters
/// come back as they are where nothing is cut, without color or grid, and with the switch off.
std::vector<Indices> splitByColor(const Cloud& cloud, const std::vector<Indices>& clusters,
                                  const ColorOptions& options);

/// Both, one after the other: clusters are joined first, then divided.
std::vector<Indices> colorCorrected(const Cloud& cloud, const std::vector<Indices>& clusters,
                                    const ColorOptions& options);

}  // namespace tabletop_perception
