#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/model.h"
#include "tabletop_perception/planar_surface.h"
#include "tabletop_perception/revolution.h"

namespace tabletop_perception {

/// A model in few points: what of it can be seen from where, and how it stands on a table. All in
/// the object's frame [m].
struct SparseModel {
  /// What a camera far away sees of the model.
  struct Side {
    Eigen::Vector3f direction = Eigen::Vector3f::UnitZ();  ///< from the model to the camera [unit]
    std::vector<int> visible;                              ///< indices into `surface`
    PlanarSurface surface;                                 ///< the visible points
    Eigen::Vector3f centroid = Eigen::Vector3f::Zero();    ///< of the visible points
    float extent = 0;  ///< at least the largest distance of two visible points
  };

  /// A way to stand, turned about the vertical by one of `yaws`.
  struct Stand {
    Eigen::Matrix3d R_table_object = Eigen::Matrix3d::Identity();  ///< z of the table is up
    double origin_height = 0;  ///< of the object's origin above the table
    double top_height = 0;     ///< of its highest point
    std::vector<double> yaws;  ///< that differ by more than the symmetry's turns [rad]
  };

  Surface surface;
  std::vector<Side> sides;    ///< in the order of icosphereDirections, about 16 deg apart
  std::vector<Stand> stands;  ///< the most probable first; none for a flat part of a surface
  std::vector<Eigen::Isometry3d> turns;  ///< motions after which it looks nearly as before, which
                                         ///< are no declared or continuous symmetry
  std::vector<Eigen::Isometry3d> spins;  ///< about an axis of continuous symmetry, in steps, the
                                         ///< identity first
  std::optional<Axis> axis;  ///< about which most of it is of revolution, but not all of it
  std::vector<Eigen::Isometry3d> alike;  ///< all motions after which its shape is nearly the same,
                                         ///< but the identity; about an axis in steps

  /// The side that is seen from a direction [unit, object to camera].
  const Side& sideTowards(const Eigen::Vector3f& direction) const;
};

SparseModel makeSparse(const ObjectModel& model);

}  // namespace tabletop_perception
