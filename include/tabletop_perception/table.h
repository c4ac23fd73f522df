#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/found.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct TableOptions {
  std::string method = "components";  ///< how planes are found: components, ransac; unorganised
                                      ///< clouds: always ransac
  double distance = 0.01;             ///< farthest a point of the table lies from its plane [m]
  int min_points = 2000;              ///< least number of points on the table
  int max_planes = 6;                 ///< planes looked at, largest first
  double level_gap = 0.005;  ///< components: pieces of one level lie no farther apart in height [m]
  double max_tilt_deg = 20;  ///< with an up direction: largest angle of the normal from it [deg]
  bool use_height_band = false;  ///< with an up direction: only tables within the band below
  double min_table_height = -2;  ///< of the table along up, from the sensor [m]
  double max_table_height = 0;   ///< [m]
  double min_height = 0.008;     ///< what stands on the table begins this high above it [m]
  double max_height = 0.5;       ///< and ends this high [m]
  double hull_margin = 0.0;      ///< how far outside the hull things still stand on the table [m]
  int min_carried = 200;         ///< least number of points above a table that carries something
  int seed = 1;                  ///< of the random samples: same input, same table

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("method", method, Choices{{"components", "ransac"}});
    visit("distance", distance, Range{0.001, 0.1});
    visit("min_points", min_points, Range{10, 1e6});
    visit("max_planes", max_planes, Range{1, 20});
    visit("level_gap", level_gap, Range{0, 0.1});
    visit("max_tilt_deg", max_tilt_deg, Range{0, 90});
    visit("use_height_band", use_height_band);
    visit("min_table_height", min_table_height, Range{-10, 10});
    visit("max_table_height", max_table_height, Range{-10, 10});
    visit("min_height", min_height, Range{0, 0.5});
    visit("max_height", max_height, Range{0.01, 5});
    visit("hull_margin", hull_margin, Range{-0.5, 0.5});
    visit("min_carried", min_carried, Range{1, 1e6});
    visit("seed", seed, Range{0, 1e9});
  }

  std::vector<Order> order() const {
    return {{"min_table_height", min_table_height, "max_table_height", max_table_height},
            {"min_height", min_height, "max_height", max_height}};
  }
};

/// A horizontal surface that carries things.
struct Table {
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();  ///< a x + b y + c z + d = 0 in the camera's
                                                    ///< frame, unit normal to the free side [m]
  /// Origin at the hull's centre on the surface, z out of it, x the camera's forward direction
  /// laid on the table.
  Eigen::Isometry3d T_camera_table = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector2d>
      hull;         ///< convex, counter-clockwise, x and y in the table's frame [m]
  Indices inliers;  ///< points of the cloud on the surface
  double rms = 0;   ///< of their distances from the plane [m]
};

/// The direction against gravity in the optical frame (x right, y down, z forward) of a camera that
/// is mounted level and looks `pitch` [deg] below the horizon.
Eigen::Vector3d upOfPitch(double pitch);

/// Signed distance of a point from the table's plane, positive on the free side [m].
inline double heightAbove(const Table& table, const Eigen::Vector3f& point) {
  return table.plane.head<3>().dot(point.cast<double>()) + table.plane[3];
}

/// Whether a point lies over the table's hull or a margin about it [m], at any height.
bool isOver(const Table& table, const Eigen::Vector3f& point, double margin);

/// The hull's corners in the camera's frame [m].
std::vector<Eigen::Vector3d> hullInCamera(const Table& table);

/// The tables, the main one first. Planes by connected components of every few pixels' normals or
/// by RANSAC over a sample; least squares over all their points. A plane that the normals of its
/// points do not bear out is a cut through clutter and no table. `up`: unit direction against
/// gravity in the cloud's frame, if it is known; then only planes seen from above, within
/// `max_tilt_deg` of it (and in the height band) count. The main table is the largest that carries
/// something, but one that another stands over, higher than `max_height`, is a floor and none.
/// Others follow by size: each carries something, is level with the largest to within 10 deg, has
/// at least a quarter of its points or stands over it, and is not the top of a thing on a table.
/// If no plane carries anything, the largest alone, with the reason "nothing stands on it". Never
/// an empty vector.
Found<std::vector<Table>> findTables(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                                     const TableOptions& options);

/// The main one of them.
Found<Table> findTable(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                       const TableOptions& options);

/// What stands on any of the tables: of `cloud` those points, the grid kept, the rest dropped.
/// Boards above others are no things: their points, and those of their edges, are dropped. Where
/// the edge of an organised cloud's picture cuts a table off, things also stand a little beyond.
Cloud pointsOnTables(const Cloud& cloud, const std::vector<Table>& tables,
                     const TableOptions& options);

/// The same points, not copied.
Indices indicesOnTables(const Cloud& cloud, const std::vector<Table>& tables,
                        const TableOptions& options);

/// The index of the table that a thing about `middle` stands on: of those below it the nearest,
/// else the main one, 0.
std::size_t tableUnder(const std::vector<Table>& tables, const Eigen::Vector3f& middle);

}  // namespace tabletop_perception
