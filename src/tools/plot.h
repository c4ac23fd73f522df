#pragma once

#include <string>
#include <vector>

namespace tabletop_perception::tools {

/// Shares, 0 to 1 on both axes.
struct PlotPoint {
  double x = 0, y = 0;
  std::string label;  ///< plain text beside the point
};

/// A line through points as an SVG element, with its axes in steps of 20 %. `diagonal`: also the
/// line on which x and y are equal.
std::string sharePlot(const std::string& x_name, const std::string& y_name,
                      const std::vector<PlotPoint>& points, bool diagonal);

}  // namespace tabletop_perception::tools
