#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct NormalsOptions {
  /// Organised clouds: "window" by the covariance of a window masked by range; the others by
  /// integral images over squares that end at jumps in range: "average_depth_change",
  /// "average_3d_gradient", "covariance" (Holzer et al. 2012). docs/performance.md compares them.
  std::string method = "window";
  int window = 7;              ///< "window": side of the square of neighbours, in steps (odd)
  int step = 2;                ///< "window": every step-th pixel gets a normal of its own, from as
                               ///< sparse a window; those between share one with the nearest of
                               ///< these on the same surface [pixels]
  double smoothing = 14;       ///< integral images: side of the square at 1 m of range; it grows
                               ///< with the range [pixels]
  double depth_change = 0.02;  ///< organised: neighbours that differ more in range do not count;
                               ///< share of the range
  int neighbors = 20;          ///< unorganised: nearest neighbours looked at

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("method", method,
          Choices{{"window", "average_depth_change", "average_3d_gradient", "covariance"}});
    visit("window", window, OddRange{{3, 31}});
    visit("step", step, Range{1, 8});
    visit("smoothing", smoothing, Range{1, 60});
    visit("depth_change", depth_change, Range{0.001, 0.5});
    visit("neighbors", neighbors, Range{3, 200});
  }
};

/// A normal per pixel of a cloud; NaN where there is none (no point, too few neighbours).
struct Normals {
  std::vector<float> x, y, z;    ///< unit length, turned towards the viewpoint
  std::vector<float> curvature;  ///< smallest eigenvalue over the sum, 0 (flat) to 1/3; NaN from
                                 ///< methods without eigenvalues ("average_...")
};

/// Normals from each point's neighbourhood: by `method` where the cloud is organised, by the
/// covariance of the nearest neighbours where it is not. `viewpoint`: the sensor [m].
Normals computeNormals(const Cloud& cloud, const Eigen::Vector3f& viewpoint,
                       const NormalsOptions& options);

/// Points one per cube of `leaf` [m] with normals from those of them within `radius` [m],
/// turned towards `viewpoint`: how a cluster, a view and a model are sampled alike for
/// descriptors and registration. Points with fewer than 4 neighbours are left out.
Surface sampleSurface(const std::vector<Eigen::Vector3f>& points, double leaf, double radius,
                      const Eigen::Vector3f& viewpoint);

}  // namespace tabletop_perception
