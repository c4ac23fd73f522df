#pragma once

#include <vector>

#include <Eigen/Geometry>

namespace tabletop_perception::tools {

/// Mean and 95th percentile.
struct Spread {
  double mean = 0, p95 = 0;
};

/// Of no values: zeros.
Spread spreadOf(std::vector<double> values);

/// How far each of some poses lies from their mean.
struct Deviations {
  std::vector<double> shifts;  ///< of the positions [m]
  std::vector<double> turns;   ///< of the rotations [rad]
};

/// The mean rotation is the one of least mean squared chordal distance (Markley et al. 2007).
Deviations deviationsFromMean(const std::vector<Eigen::Isometry3d>& poses);

}  // namespace tabletop_perception::tools
