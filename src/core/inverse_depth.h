#pragma once

#include <cstddef>
#include <vector>

#include "tabletop_perception/depth_image.h"

namespace tabletop_perception {

/// Inverse depths per pixel [1/m], NaN where there is none. Those of a plane are linear in column
/// and row.
struct InverseDepths {
  int width, height;
  std::vector<float> values;

  const float* row(int v) const { return &values[static_cast<std::size_t>(v) * width]; }
  float* row(int v) { return &values[static_cast<std::size_t>(v) * width]; }
};

/// One pixel for every square of `side` pixels: the mean of those on the surface of their median
/// (of two surfaces with equal shares the nearer), none unless they are half of the square.
InverseDepths decimated(const InverseDepths& depths, int side, float edge);

/// Every pixel the mean of the window about it. Neighbours on opposite sides count together, and
/// only where the three lie on a line: edges stay, and planes too, up to their very borders.
InverseDepths smoothed(const InverseDepths& depths, int radius, float edge);

/// Mixes what was seen before into pixels that changed by less than an edge; `memory` keeps the
/// result.
void steady(InverseDepths& depths, float newest_weight, float edge, DepthMemory& memory);

/// Fills holes of at most `max_hole` pixels along a row, where both sides are of one surface.
void fillHoles(InverseDepths& depths, int max_hole, float edge);

}  // namespace tabletop_perception
