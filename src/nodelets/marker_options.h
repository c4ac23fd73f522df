#pragma once

#include "tabletop_perception/options.h"

namespace tabletop_perception {

/// How things are drawn in rviz.
struct MarkerOptions {
  double text_height = 0.03;  ///< height of a capital letter of a name [m]
  double line_width = 0.004;  ///< of the table's hull and the boxes [m]
  double text_gap = 0.03;     ///< of a name above its object [m]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("text_height", text_height, Range{0.001, 1});
    visit("line_width", line_width, Range{0.0005, 0.1});
    visit("text_gap", text_gap, Range{0, 1});
  }
};

}  // namespace tabletop_perception
