#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/options.h"
#include "tabletop_perception/packed_cloud.h"

namespace tabletop_perception {

/// Crops keep an organised cloud organised; outlier removal too; a voxel grid does not.
struct FilterOptions {
  double min_range = 0.1;  ///< nearer points are dropped; distance from the sensor [m]
  double max_range = 2.0;  ///< farther points are dropped [m]

  std::string crop_axis = "none";  ///< pass-through along "x", "y" or "z" of the cloud's frame
  double crop_min = -2.5;          ///< [m]
  double crop_max = 2.5;           ///< [m]

  bool box = false;                                       ///< drop what is outside the box below
  double box_x = 0, box_y = 0, box_z = 1;                 ///< its centre in the cloud's frame [m]
  double box_roll = 0, box_pitch = 0, box_yaw = 0;        ///< about x, then y, then z [rad]
  double box_size_x = 1, box_size_y = 1, box_size_z = 1;  ///< full sides [m]

  double leaf_size = 0;  ///< voxel grid; 0: none, and the cloud stays organised [m]

  std::string outliers = "none";    ///< "none", "statistical" or "radius"
  int outlier_neighbors = 20;       ///< statistical: neighbours looked at; radius: least number
  double outlier_deviations = 2.0;  ///< statistical: standard deviations beyond the mean distance
  double outlier_radius = 0.02;     ///< radius: within which the neighbours must lie [m]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("min_range", min_range, Range{0, 100});
    visit("max_range", max_range, Range{0.01, 100});
    visit("crop_axis", crop_axis, Choices{{"none", "x", "y", "z"}});
    visit("crop_min", crop_min, Range{-100, 100});
    visit("crop_max", crop_max, Range{-100, 100});
    visit("box", box);
    visit("box_x", box_x, Range{-100, 100});
    visit("box_y", box_y, Range{-100, 100});
    visit("box_z", box_z, Range{-100, 100});
    visit("box_roll", box_roll, Range{-3.15, 3.15});
    visit("box_pitch", box_pitch, Range{-3.15, 3.15});
    visit("box_yaw", box_yaw, Range{-3.15, 3.15});
    visit("box_size_x", box_size_x, Range{0.001, 100});
    visit("box_size_y", box_size_y, Range{0.001, 100});
    visit("box_size_z", box_size_z, Range{0.001, 100});
    visit("leaf_size", leaf_size, Range{0, 0.1});
    visit("outliers", outliers, Choices{{"none", "statistical", "radius"}});
    visit("outlier_neighbors", outlier_neighbors, Range{1, 1000});
    visit("outlier_deviations", outlier_deviations, Range{0, 10});
    visit("outlier_radius", outlier_radius, Range{0.001, 1});
  }

  std::vector<Order> order() const {
    return {{"min_range", min_range, "max_range", max_range},
            {"crop_min", crop_min, "crop_max", crop_max}};
  }
};

/// Drops points nearer than `min` or farther than `max` from the sensor [m].
Cloud cropRange(Cloud cloud, double min, double max);

/// Drops points outside [min, max] along one axis, 0, 1 or 2 for x, y, z [m].
Cloud cropAxis(Cloud cloud, int axis, double min, double max);

/// Drops points outside a box with the given full sides about the origin of its frame [m].
Cloud cropBox(Cloud cloud, const Eigen::Isometry3d& T_camera_box, const Eigen::Vector3d& size);

/// One point per occupied cube of `leaf` [m], the mean of its points and colours, unorganised.
/// Cubes are numbered up to 2^30 from the origin; what lies beyond shares the last. Throws unless
/// `leaf` is positive.
Cloud voxelGrid(const Cloud& cloud, double leaf);

/// Drops points whose mean distance to their `neighbors` nearest is more than `deviations`
/// standard deviations above the mean of that figure over the cloud (Rusu et al. 2008).
Cloud removeStatisticalOutliers(const Cloud& cloud, int neighbors, double deviations);

/// Drops points with fewer than `neighbors` others within `radius` [m].
Cloud removeRadiusOutliers(const Cloud& cloud, int neighbors, double radius);

/// All of the above as the options say, in that order. Throws std::invalid_argument for options
/// that contradict each other (min_range not below max_range).
Cloud filterCloud(Cloud cloud, const FilterOptions& options);

/// The same for a cloud as bytes, cropped by range while it is read; throws as unpackCloud does,
/// too.
Cloud filterCloud(const PackedCloud& packed, const FilterOptions& options);

}  // namespace tabletop_perception
