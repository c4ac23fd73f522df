#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/agreement.h"
#include "tabletop_perception/descriptor.h"
#include "tabletop_perception/found.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct MatchOptions {
  std::string kinds = "vfh cvfh";     ///< descriptors compared: some of "vfh", "cvfh", "our_cvfh",
                                      ///< "esf", with spaces between
  std::string metric = "chi_square";  ///< distance of two histograms: "l1", "l2", "chi_square"
  int neighbors = 10;                 ///< nearest views of each kind that are looked at
  double max_distance = 400;          ///< views farther than this are no match [of the metric]
  double max_size_ratio = 1.3;        ///< clusters larger than this times a view do not match it
  double min_size_ratio = 0.3;        ///< clusters smaller than this times a view do not either
  double union_gap = 0.015;           ///< clusters this near are also matched as one; 0: never [m]
  std::string roll = "steps";         ///< where turns about the viewing axis come from: "steps"
                                      ///< of the circle, "histogram": peaks of the camera roll
  int rolls = 24;                     ///< such turns per view; with "histogram" at most
  bool stands = true;  ///< every model is also tried in every way that it stands on the table
  bool parts = true;   ///< the smooth parts of a cluster that resembles nothing are matched too
  bool color = true;   ///< colours count where both model and scene have them
  int max_candidates = 10;  ///< best initial poses kept per cluster, and per part of it
  int threads = 1;          ///< clusters matched at a time; the answers are the same
  double keep = 2;  ///< how long a cluster that stays as it is keeps its candidates; 0: not [s]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("kinds", kinds, WordList{{"vfh", "cvfh", "our_cvfh", "esf"}});
    visit("metric", metric, Choices{{"l1", "l2", "chi_square"}});
    visit("neighbors", neighbors, Range{1, 1000});
    visit("max_distance", max_distance, Range{0, 1e6});
    visit("max_size_ratio", max_size_ratio, Range{0.1, 100});
    visit("min_size_ratio", min_size_ratio, Range{0, 1});
    visit("union_gap", union_gap, Range{0, 0.2});
    visit("roll", roll, Choices{{"steps", "histogram"}});
    visit("rolls", rolls, Range{1, 360});
    visit("stands", stands);
    visit("parts", parts);
    visit("color", color);
    visit("max_candidates", max_candidates, Range{1, 1000});
    visit("threads", threads, Range{1, 64});
    visit("keep", keep, Range{0, 3600});
  }
};

/// A view that looks like a cluster.
struct Neighbor {
  int model;                         ///< index into the models of the ModelIndex
  int view;                          ///< index into its views
  Eigen::Vector3f view_centroid;     ///< of what was described, in the view's frame [m]
  Eigen::Vector3f cluster_centroid;  ///< of what was described, in the camera's frame [m]
  double distance;                   ///< of the descriptors, in the metric
  std::optional<Eigen::Matrix3f> R_camera_view;  ///< where descriptors have axes, these agree
};

/// A pose in which a view shows a model as a cluster looks.
struct ViewPose {
  int model;  ///< index into the models of the ModelIndex
  Eigen::Isometry3d T_camera_object;
  double distance;  ///< of the descriptors, in the metric
};

struct ViewPoses {
  std::vector<ViewPose> poses;
  bool any_of_size = false;  ///< whether any view is of the cluster's size, near or not
};

/// A guess at what a cluster is and where.
struct Candidate {
  std::string name;     ///< of the object
  double distance = 0;  ///< of the descriptors, in the metric
  double promise = 0;   ///< how well it agrees with what the camera saw after a few steps of ICP,
                        ///< 0 to 1
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
};

/// Distance of two histograms of equal length by the named metric. Chi-square is
/// sum (a - b)^2 / (a + b) over the bins where a + b > 0.
double histogramDistance(const float* a, const float* b, int size, const std::string& metric);

/// The nearest vectors of the descriptor's kind, nearest first, none beyond `max_distance` and none
/// of a view that is much larger or smaller than `extent`, the described cluster's [m].
std::vector<Neighbor> nearestViews(const Descriptor& descriptor, double extent,
                                   const ModelIndex& index, const MatchOptions& options);

/// The pose that a view suggests: the centroids coincide and, where the descriptors have axes,
/// these too. Otherwise the viewing axes through the centroids are brought together, and the object
/// is turned by `roll` [rad] about the axis.
Eigen::Isometry3d poseFromView(const Neighbor& neighbor, const View& view, double roll);

/// The turns about the viewing axis [rad], best first, at which a view's camera-roll histogram
/// agrees with a cluster's; none where one of the two faces the camera and says nothing.
std::vector<double> rollsFromHistograms(const float* of_cluster, const float* of_view,
                                        const Neighbor& neighbor);

/// The poses in which the nearest views of each descriptor of a cluster show it.
ViewPoses posesFromViews(const std::vector<Descriptor>& descriptors, double extent,
                         const ModelIndex& index, const MatchOptions& options);

/// Candidates for a cluster sampled by `sampleSurface`, most promising first. Guesses come from the
/// nearest views of each kind of descriptor at every roll and from all ways that a model of fitting
/// size stands on the table; where none of them promises much, also from the cluster's smooth
/// parts, for a cluster may hold several things. The guesses that explain most are held against the
/// picture, and the best of those moved by a few steps of ICP. None, with the reason, for a cluster
/// that is too small, an empty database, or no view within the limits.
Found<std::vector<Candidate>> matchCluster(const Surface& cluster, const Observation& observation,
                                           const ModelIndex& index, const MatchOptions& options);

}  // namespace tabletop_perception
