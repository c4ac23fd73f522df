#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct PlaneOptions {
  double max_angle_deg = 8;     ///< between the normals of neighbours on one plane [deg]
  double max_offset = 0.01;     ///< of a point from its neighbour's plane [m]
  double max_curvature = 0.03;  ///< sharper points lie on no plane; 0 flat to 1/3
  int min_points = 60;          ///< smaller planes are dropped

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("max_angle_deg", max_angle_deg, Range{0.1, 90});
    visit("max_offset", max_offset, Range{1e-4, 1});
    visit("max_curvature", max_curvature, Range{0, 0.34});
    visit("min_points", min_points, Range{3, 1e6});
  }
};

/// A flat piece of surface.
struct Plane {
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();     ///< a x + b y + c z + d = 0, unit normal
                                                       ///< to the side its points face [m]
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  ///< of its points [m]
  Indices points;                                      ///< of the cloud
  double rms = 0;                                      ///< of their distances from it [m]
};

/// Planes by connected components of an organised cloud (Trevor et al. 2013): neighbouring pixels
/// belong together where their normals agree and each lies on the other's plane. Each is fitted by
/// least squares to its points; a component that bends is no plane. Largest first; an unorganised
/// cloud has none. `normals`: one per point, as computeNormals gives them.
std::vector<Plane> findPlanes(const Cloud& cloud, const Normals& normals,
                              const PlaneOptions& options);

/// Which planes are wanted: those whose normal is within an angle of a direction.
struct PlaneConstraint {
  Eigen::Vector3d direction;  ///< unit
  double min_cosine;          ///< of the angle, either sign of the normal
};

/// The plane with the most points within `distance` [m] of it: drawn by RANSAC from a thousand of
/// the points (Fischler & Bolles 1981), then fitted by least squares to all that are near, its
/// normal towards the sensor. Same input and seed, same plane; none when no three points span one
/// that meets the constraint. Needs no grid.
std::optional<Plane> findLargestPlane(const Cloud& cloud, double distance,
                                      const std::optional<PlaneConstraint>& constraint,
                                      std::uint32_t seed);

/// One plane through the points of two that face alike, of the same cloud.
Plane mergedPlane(const Cloud& cloud, const Plane& a, const Plane& b);

/// Of those of the given points that have a normal, the share whose normal is that of a plane to
/// within 15 deg, whichever its sign; 0 when none has. What is cut out of a volume has few.
double normalAgreement(const Normals& normals, const Indices& points,
                       const Eigen::Vector3d& normal);

/// The least agreement of a plane's points with its normal.
constexpr double MIN_NORMAL_AGREEMENT = 0.6;

}  // namespace tabletop_perception
