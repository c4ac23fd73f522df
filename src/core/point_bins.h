#pragma once

#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/geometry.h"

namespace tabletop_perception {

/// A surface as arrays of one coordinate each: loops over them become vector instructions.
struct PlanarSurface {
  std::vector<float> x, y, z;     ///< of the points [m]
  std::vector<float> nx, ny, nz;  ///< of their normals

  explicit PlanarSurface(const Surface& surface);
  std::size_t size() const { return x.size(); }
};

/// What the points of a surface are held against.
struct OrientedPoint {
  Eigen::Vector3f centroid;  ///< [m]
  Eigen::Vector3f axis;      ///< unit
  Eigen::Vector3f gaze;      ///< unit, towards the viewpoint
};

struct BinCounts {
  int shape;             ///< of each angle and of the distance
  int view;              ///< of the angle to the gaze
  float distance_range;  ///< fills the last bin of the distance [m]
};

/// Histograms of all points of a surface against an oriented point (Rusu et al. 2010, eq. 1 to 3),
/// each in its own range and of the sum 100.
struct PointBins {
  std::vector<float> alpha, phi, theta;  ///< three angles of the points' normals and places
  std::vector<float> distance;           ///< from the centroid
  std::vector<float> view;               ///< cosine of the normals to the gaze

  PointBins(const PlanarSurface& surface, const OrientedPoint& against, const BinCounts& counts);
};

}  // namespace tabletop_perception
