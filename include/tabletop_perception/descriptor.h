#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

/// How a cluster is sampled and described: the same at training and at work, so these options are
/// stored with every object, and a database trained with others is refused.
struct DescriptorOptions {
  double leaf = 0.005;             ///< spacing of the sampled points [m]
  double normal_radius = 0.015;    ///< neighbourhood of a normal [m]
  int min_points = 40;             ///< smaller samples are not described
  double region_angle_deg = 10;    ///< CVFH: largest angle between neighbours of one region [deg]
  double region_curvature = 0.05;  ///< CVFH: points whose neighbours' normals cancel out more join
                                   ///< no region; 0 flat; a sampled right-angled edge has under 0.1
  double region_radius = 0.0125;   ///< CVFH: neighbours lie this near [m]
  int region_min_points = 25;      ///< CVFH: smaller regions are dropped

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("leaf", leaf, Range{0.001, 0.05});
    visit("normal_radius", normal_radius, Range{0.001, 0.2});
    visit("min_points", min_points, Range{5, 1e5});
    visit("region_angle_deg", region_angle_deg, Range{1, 90});
    visit("region_curvature", region_curvature, Range{0, 1});
    visit("region_radius", region_radius, Range{0.001, 0.2});
    visit("region_min_points", region_min_points, Range{3, 1e5});
  }
};

/// The length of VFH and CVFH vectors: 4 x 45 bins of shape and 128 of viewpoint.
constexpr int VFH_SIZE = 308;

/// One vector that describes a surface as seen from somewhere.
struct Descriptor {
  std::string kind;           ///< "vfh" or "cvfh"; only equal kinds are compared
  std::vector<float> values;  ///< the histogram, each block sums to 100
  Eigen::Vector3f centroid = Eigen::Vector3f::Zero();  ///< of what it describes, its frame [m]
};

/// Viewpoint Feature Histogram (Rusu et al. 2010) of a surface seen from `viewpoint` [m], in the
/// ranges of the paper: three angles of each point's normal against the centroid's frame, distance
/// from the centroid, and the angle of normals to the viewing direction.
/// Throws std::invalid_argument for an empty surface.
Descriptor computeVfh(const Surface& surface, const Eigen::Vector3f& viewpoint);

/// The smooth regions that CVFH speaks of, and last, perhaps empty, all that is in none: edges and
/// scattered points.
std::vector<Surface> smoothParts(const Surface& surface, const DescriptorOptions& options);

/// Clustered VFH (Aldoma et al. 2011): one vector per smooth region, computed from the region's
/// centroid and mean normal over all points, distances not normalised. Surfaces without a smooth
/// region yield none.
std::vector<Descriptor> computeCvfh(const Surface& surface, const Eigen::Vector3f& viewpoint,
                                    const DescriptorOptions& options);

/// VFH first, then every CVFH; empty for a surface under `min_points`.
std::vector<Descriptor> describeSurface(const Surface& surface, const Eigen::Vector3f& viewpoint,
                                        const DescriptorOptions& options);

}  // namespace tabletop_perception
