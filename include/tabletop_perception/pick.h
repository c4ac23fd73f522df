#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/found.h"
#include "tabletop_perception/options.h"
#include "tabletop_perception/projection.h"
#include "tabletop_perception/table.h"

/// The thing that somebody points at, and a frame to grasp it by.
namespace tabletop_perception {

struct PickOptions {
  int pixel_window = 11;            ///< side of the square in which a pixel without depth takes the
                                    ///< nearest one's (odd) [pixels]
  double max_distance = 0.03;       ///< farthest a point may lie from what the camera saw [m]
  double reach = 0.3;               ///< how far from the point its thing is looked for [m]
  double surface_distance = 0.005;  ///< points of one surface lie no farther from its plane [m]
  double depth = 0.02;  ///< from the surface's middle into the thing to the frame's origin [m]

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("pixel_window", pixel_window, OddRange{{1, 101}});
    visit("max_distance", max_distance, Range{0.001, 0.5});
    visit("reach", reach, Range{0.05, 5});
    visit("surface_distance", surface_distance, Range{0.0005, 0.05});
    visit("depth", depth, Range{0, 0.5});
  }
};

/// The point of an organised cloud at a pixel or, where that has none, at the pixel nearest to it
/// within the window. None, with the reason, outside the image, without depth in the window, and of
/// an unorganised cloud.
Found<Eigen::Vector3f> pointAtPixel(const Cloud& cloud, const Eigen::Vector2d& pixel, int window);

/// The same with a camera's own pixels, of whatever size and for any cloud in its frame: of the
/// points that fall into the window the one nearest to the pixel, the frontmost of those that fall
/// into one pixel.
Found<Eigen::Vector3f> pointAtPixel(const Cloud& cloud, const Projection& projection,
                                    const Eigen::Vector2d& pixel, int window);

/// A part of a cloud.
struct CloudWindow {
  Cloud cloud;
  Indices source;           ///< unorganised: of the whole cloud, one per point
  int column = 0, row = 0;  ///< organised: of the whole cloud, where its first pixel lies
  int step = 1;             ///< organised: between its pixels in the whole cloud
  int whole_width = 0;      ///< organised: of the whole cloud

  /// Index in the whole cloud.
  int sourceOf(int i) const;
};

/// What the camera saw around a point: of an organised cloud the rectangle of pixels that holds
/// every point within `reach` [m], every step-th pixel and row of it; of an unorganised one those
/// points.
CloudWindow windowAround(const Cloud& cloud, const Eigen::Vector3f& point, double reach,
                         int step = 1);

/// Every pixel of what a window of an organised cloud shows.
CloudWindow withEveryPixel(const Cloud& cloud, const CloudWindow& window);

/// Which of the clusters somebody means who points at `point`: the one with the nearest point, not
/// the one with the nearest centroid, which of a large thing may be farther away than that of a
/// small one beside it. A point that is on none of them but all around which the nearest one lies
/// belongs to that, with the reason why it is on none: the bottom of a bowl is as low as the table,
/// and that of a mug that lies is a patch too small for a thing (all around it as the camera sees
/// it, not from above).
/// None, with the reason, for a point in the air, on a table, or on what stands on none. `cloud`:
/// what the clusters' points belong to.
Found<int> clusterAt(const Cloud& cloud, const std::vector<Indices>& clusters,
                     const Eigen::Vector3f& point, const std::vector<Table>& tables,
                     const TableOptions& table_options, const PickOptions& options);

/// The largest flat surface that a thing shows, and the frame to grasp it by.
struct GraspSurface {
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();    ///< unit normal to the camera [m]
  Eigen::Vector2d extents = Eigen::Vector2d::Zero();  ///< along x and y of the frame [m]
  int points = 0;                                     ///< on the surface
  /// Origin behind the middle of the surface, z out of it towards the camera, x along its longer
  /// side: up where it rises, else away from the camera or to its left, whichever is more.
  Eigen::Isometry3d T_camera_pick = Eigen::Isometry3d::Identity();
};

/// Of a thing's points in a cloud. None, with the reason, where they span no plane. The origin lies
/// `depth` behind the surface, but never below half of the surface's height above the table.
Found<GraspSurface> graspSurface(const Cloud& cloud, const Indices& thing, const Table& table,
                                 const PickOptions& options);

}  // namespace tabletop_perception
