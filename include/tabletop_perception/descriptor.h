#pragma once

#include <optional>
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
  double region_angle_deg = 10;    ///< largest angle between neighbours of a smooth region [deg]
  double region_curvature = 0.05;  ///< points whose neighbours' normals cancel out more do not grow
                                   ///< a region; 0 flat; a sampled right-angled edge has under 0.1
  double region_radius = 0.0125;   ///< neighbours lie this near [m]
  int region_min_points = 25;      ///< smaller regions are dropped

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("leaf", leaf, Range{0.001, 0.05});
    visit("normal_radius", normal_radius, Range{0.001, 0.2});
    visit("min_points", min_points, Range{5, 1e5});
    visit("region_angle_deg", region_angle_deg, Range{1, 90});
    visit("region_curvature", region_curvature, Range{0, 0.34});
    visit("region_radius", region_radius, Range{0.001, 0.2});
    visit("region_min_points", region_min_points, Range{3, 1e5});
  }
};

/// The length of VFH and CVFH vectors: 4 x 45 bins of shape and 128 of viewpoint.
constexpr int VFH_SIZE = 308;
constexpr int SHAPE_BINS = 45;
constexpr int VIEW_BINS = 128;
/// Of OUR-CVFH: 3 x 45 bins of angles, 8 octants x 13 of distance, 64 of viewpoint.
constexpr int OUR_CVFH_SIZE = 303;
/// Of ESF: 10 shape functions x 64 bins.
constexpr int ESF_SIZE = 640;
/// Of a camera-roll histogram: turns of 4 degrees.
constexpr int ROLL_BINS = 90;

/// Kinds of descriptors that views are looked up by.
constexpr const char* DESCRIPTOR_KINDS[] = {"vfh", "cvfh", "our_cvfh", "esf"};

/// One vector that describes a surface as seen from somewhere.
struct Descriptor {
  std::string kind;           ///< one of DESCRIPTOR_KINDS, or "camera_roll"; equals are compared
  std::vector<float> values;  ///< the histogram; each block sums to 100, but of "camera_roll"
  Eigen::Vector3f centroid = Eigen::Vector3f::Zero();  ///< of what it describes, its frame [m]
  /// Axes of a frame that turns with the object, as columns, in the frame of what it describes:
  /// that of "our_cvfh"; the other kinds have none.
  std::optional<Eigen::Matrix3f> axes;
};

/// Viewpoint Feature Histogram (Rusu et al. 2010) of a surface seen from `viewpoint` [m], in the
/// ranges of the paper: three angles of each point's normal against the centroid's frame, distance
/// from the centroid, and the angle of normals to the viewing direction.
/// Throws std::invalid_argument for an empty surface.
Descriptor computeVfh(const Surface& surface, const Eigen::Vector3f& viewpoint);

/// The bins of pcl::VFHEstimation, PCL 1.13, with setNormalizeDistance and setFillSizeComponent:
/// the paper's features in other ranges. To check against PCL; such bins are never stored. Throws
/// std::invalid_argument for under two points.
std::vector<float> computeVfhAsPcl(const Surface& surface, const Eigen::Vector3f& viewpoint);

/// The smooth regions that CVFH and OUR-CVFH speak of, largest first: indices into the surface.
std::vector<std::vector<int>> smoothRegions(const Surface& surface,
                                            const DescriptorOptions& options);

/// The smooth regions as surfaces, largest first, and last, perhaps empty, all that is in none:
/// edges and scattered points.
std::vector<Surface> smoothParts(const Surface& surface, const DescriptorOptions& options);

/// Clustered VFH (Aldoma et al. 2011): one vector per smooth region, computed from the region's
/// centroid and mean normal over all points, distances not normalised.
std::vector<Descriptor> computeCvfh(const Surface& surface,
                                    const std::vector<std::vector<int>>& regions,
                                    const Eigen::Vector3f& viewpoint);

/// OUR-CVFH (Aldoma et al. 2012): one vector per smooth region and semi-global unique reference
/// frame of it. The frame has its origin in the region's centroid and z along the mean normal; x is
/// the direction in which the region is longest, towards the side where more of the whole surface
/// lies. Where a region has no longest direction or no fuller side, there is a frame for every
/// choice. Distances of the points, in metres, are counted by the frame's octants.
std::vector<Descriptor> computeOurCvfh(const Surface& surface,
                                       const std::vector<std::vector<int>>& regions,
                                       const Eigen::Vector3f& viewpoint);

/// Ensemble of Shape Functions (Wohlkinger and Vincze 2011): angles, areas and distances of random
/// triples of points, each by whether the line between them runs on the surface, beside it, or
/// partly so; no normals are used. `spacing` of the points [m]. The same points in the same order
/// give the same vector. Throws std::invalid_argument for under three points.
Descriptor computeEsf(const Surface& surface, double spacing);

/// Camera-roll histogram (Aldoma et al. 2011): the angles of the normals about the viewing axis
/// through the centroid, in the frame that rotationBetween turns that axis to z by, each by how far
/// the normal leans across the axis. Sums to 100 where all lie across it, to 0 where none leans.
Descriptor computeCameraRoll(const Surface& surface, const Eigen::Vector3f& viewpoint);

/// The wanted kinds of descriptors, in the order of DESCRIPTOR_KINDS, then the camera roll; empty
/// for a surface under `min_points`.
std::vector<Descriptor> describeSurface(const Surface& surface, const Eigen::Vector3f& viewpoint,
                                        const DescriptorOptions& options,
                                        const std::vector<std::string>& kinds = {
                                            std::begin(DESCRIPTOR_KINDS),
                                            std::end(DESCRIPTOR_KINDS)});

}  // namespace tabletop_perception
