#pragma once

#include <cstddef>
#include <vector>

#include "tabletop_perception/geometry.h"

namespace tabletop_perception {

/// A few points with their normals as planar arrays, of a length that loops over them turn into
/// whole vector registers.
struct PlanarBlock {
  static constexpr int SIZE = 32;
  alignas(32) float x[SIZE], y[SIZE], z[SIZE];  ///< [m]
  float nx[SIZE], ny[SIZE], nz[SIZE];           ///< unit length
};

/// A surface in blocks, for kernels that hold it against many poses. The last block is filled up
/// with points that are NaN; so are points that were not finite.
struct PlanarSurface {
  PlanarSurface() = default;
  PlanarSurface(const Surface& surface);  // NOLINT(google-explicit-constructor): only a layout

  /// Adds the points of another, block by block.
  void append(const PlanarSurface& other);

  std::vector<PlanarBlock> blocks;
  std::size_t size = 0;  ///< of the surface, without what fills blocks up
};

}  // namespace tabletop_perception
