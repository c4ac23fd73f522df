#pragma once

#include <string>

#include <Eigen/Geometry>

#include "tabletop_perception/found.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/nearest_grid.h"
#include "tabletop_perception/options.h"
#include "tabletop_perception/planar_surface.h"

namespace tabletop_perception {

struct RefineOptions {
  std::string method = "point_to_plane";  ///< or "point_to_point", "gicp"
  int max_iterations = 40;
  double start_distance = 0.03;      ///< farthest correspondence at the first iteration [m]
  double max_distance = 0.008;       ///< farthest correspondence at the last iterations [m]
  double trim = 0.9;                 ///< share of correspondences that counts, nearest first
  double min_rotation = 0.0005;      ///< a smaller step ends the iteration, with the next [rad]
  double min_translation = 0.00005;  ///< [m]
  double min_overlap = 0.3;          ///< least share of the cluster with correspondences
  double keep = 2;  ///< how long a thing that stays as it is is not decided anew; 0: not [s]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("method", method, Choices{{"point_to_plane", "point_to_point", "gicp"}});
    visit("max_iterations", max_iterations, Range{1, 1000});
    visit("start_distance", start_distance, Range{0.001, 0.5});
    visit("max_distance", max_distance, Range{0.001, 0.5});
    visit("trim", trim, Range{0.1, 1});
    visit("min_rotation", min_rotation, Range{0, 0.1});
    visit("min_translation", min_translation, Range{0, 0.01});
    visit("min_overlap", min_overlap, Range{0, 1});
    visit("keep", keep, Range{0, 3600});
  }
};

/// Where ICP ended.
struct Alignment {
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  double rms = 0;      ///< of the trimmed correspondences' point distances [m]
  double overlap = 0;  ///< share of the cluster within `max_distance` of the model
  int iterations = 0;
  bool converged = false;  ///< false: the limit of iterations was reached
};

/// ICP of a cluster's points against the whole model that a grid was made of, starting at
/// `T_camera_object`: closest points
/// (Besl & McKay 1992), tangent planes (Chen & Medioni 1992) or plane to plane (GICP; Segal,
/// Haehnel, Thrun 2009), trimmed (Chetverikov et al. 2002).
/// Points that are not finite count for nothing. None, with the reason, when fewer than 6
/// points or `min_overlap` of them find a correspondence.
Found<Alignment> refinePose(const PlanarSurface& cluster, const NearestGrid& model,
                            const Eigen::Isometry3d& T_camera_object, const RefineOptions& options);

}  // namespace tabletop_perception
