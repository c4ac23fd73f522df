#pragma once

namespace tabletop_perception {

/// Sums over the points of several neighbourhoods side by side, each relative to its middle, which
/// keeps single precision exact enough: how many points, their coordinates and the products.
struct LaneMoments {
  static constexpr int LANES = 32;  ///< fewer: loops are unrolled before they are vectorised
  float n[LANES] = {}, x[LANES] = {}, y[LANES] = {}, z[LANES] = {}, xx[LANES] = {}, xy[LANES] = {},
        xz[LANES] = {}, yy[LANES] = {}, yz[LANES] = {}, zz[LANES] = {};
};

/// Unit normals, and curvatures: the share of the variance that lies along the normal. NaN where
/// the points are too few or lie on a line.
struct LaneNormals {
  float x[LaneMoments::LANES], y[LaneMoments::LANES], z[LaneMoments::LANES],
      curvature[LaneMoments::LANES];
};

/// The direction of least variance of each neighbourhood.
void fitPlanes(const LaneMoments& sums, LaneNormals& out);

}  // namespace tabletop_perception
