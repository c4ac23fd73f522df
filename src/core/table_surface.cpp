#include "table_surface.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "convex_hull.h"
#include "plane_fit.h"
#include "plane_raster.h"
#include "union_find.h"

namespace tabletop_perception {
namespace {

constexpr double PATCH_CELL = 0.02;       // raster in which a patch of table is connected [m]
constexpr double MIN_PATCH_SHARE = 0.05;  // of the largest patch: smaller ones are chance
constexpr int MAX_CELLS = 2000;           // along one side of the raster
constexpr double VIEW_EDGE = 0.03;        // strip along the edge of a picture, share of its width
constexpr double BEYOND_VIEW = 0.1;       // that a table goes on where the picture cuts it off [m]
constexpr double HULL_SLACK = 0.005;  // the hull's own corners lie on the table, noise or not [m]

/// A frame on a plane: origin at the foot of the sensor's perpendicular, z along the plane's
/// normal, x nearest to `forward`.
Eigen::Isometry3d frameOnPlane(const Eigen::Vector4d& plane, const Eigen::Vector3d& forward) {
  const Eigen::Vector3d z = plane.head<3>();
  Eigen::Vector3d x = forward - z * z.dot(forward);
  if (x.norm() < 0.05) x = z.unitOrthogonal();  // looked at from straight above
  x.normalize();
  Eigen::Isometry3d T_camera_plane;
  T_camera_plane.linear() << x, z.cross(x), z;
  T_camera_plane.translation() = -plane[3] * z;
  T_camera_plane.makeAffine();
  return T_camera_plane;
}

/// Which cells of the raster belong to a patch of the table: objects and their shadows cut one
/// table into several, while a plane also meets, by chance, a few points of other things.
std::vector<std::uint8_t> patchesOf(const PlaneRaster& raster) {
  const std::vector<int> points = raster.pointsByCell();
  const int columns = raster.columns(), size = static_cast<int>(points.size());
  const auto inBorder = [&](int cell) {
    return cell < columns || cell >= size - columns || cell % columns == 0 ||
           cell % columns == columns - 1;
  };
  std::vector<std::uint8_t> grown(points.size(), false);  // over the gaps that a patch may have
  for (int cell = 0; cell < size; ++cell)
    if (points[cell] > 0)
      for (const int row : {-columns, 0, columns})
        for (const int column : {-1, 0, 1}) grown[cell + row + column] = true;

  UnionFind patches(points.size());
  for (int cell = 0; cell < size; ++cell) {
    if (!grown[cell] || inBorder(cell)) continue;
    for (const int other : {cell - 1, cell - columns - 1, cell - columns, cell - columns + 1})
      if (grown[other] && !inBorder(other)) patches.join(cell, other);
  }
  std::vector<int> sizes(points.size(), 0);  // by root
  for (int cell = 0; cell < size; ++cell) sizes[patches.root(cell)] += points[cell];
  const double least =
      std::max(1.0, MIN_PATCH_SHARE * *std::max_element(sizes.begin(), sizes.end()));
  std::vector<std::uint8_t> in_patch(points.size());
  for (int cell = 0; cell < size; ++cell) in_patch[cell] = sizes[patches.root(cell)] >= least;
  return in_patch;
}

/// The points near the plane in one row of an organised cloud, or one of an unorganised cloud.
struct TableRow {
  Stretch near;
  Stretch
      patch;  ///< from the first to the last of a patch; empty, at the end of `near`, if none is

  bool hasPatch() const { return patch.first <= patch.last; }
};

std::vector<TableRow> rowsOf(const PlaneRaster& raster) {
  const std::vector<std::uint8_t> in_patch = patchesOf(raster);
  std::vector<TableRow> rows;
  for (const auto& near : raster.nearStretches()) {
    auto [first, last] = near;
    while (first <= last && !in_patch[raster.cellOf(first)]) ++first;
    while (last > first && !in_patch[raster.cellOf(last)]) --last;
    rows.push_back({near, {first, last}});
  }
  return rows;
}

/// The ends of the rows of patches: no other point can be a corner of the hull.
std::vector<Eigen::Vector2f> outlineOf(const Cloud& cloud, const std::vector<TableRow>& rows,
                                       const Eigen::Isometry3d& T_camera_table) {
  const Flattener flatten(T_camera_table);
  std::vector<Eigen::Vector2f> outline;
  for (const auto& row : rows) {
    if (!row.hasPatch()) continue;
    outline.push_back(flatten(cloud, row.patch.first));
    if (row.patch.last > row.patch.first) outline.push_back(flatten(cloud, row.patch.last));
  }
  return outline;
}

/// The points within `distance` of a table, in or at its hull. Of those between points of patches
/// that need not be asked.
Indices pointsOfTable(const Cloud& cloud, const std::vector<TableRow>& rows, const Table& table,
                      double distance) {
  const Flattener flatten(table.T_camera_table);
  const ConvexRegion region(table.hull, HULL_SLACK);
  Indices points;
  points.reserve(cloud.size());
  const auto append = [&](int begin, int end) {
    appendBetween(cloud, begin, end, table.plane, -distance, distance, points);
  };
  const auto appendWithinHull = [&](int begin, int end) {
    const auto before = static_cast<std::ptrdiff_t>(points.size());
    append(begin, end);
    const auto outside = [&](int i) {
      const Eigen::Vector2f p = flatten(cloud, i);
      return !region.contains(p.x(), p.y());
    };
    points.erase(std::remove_if(points.begin() + before, points.end(), outside), points.end());
  };
  for (const auto& [near, patch] : rows) {
    appendWithinHull(near.first, patch.first);
    append(patch.first, patch.last + 1);
    appendWithinHull(patch.last + 1, near.last + 1);
  }
  return points;
}

/// Whether two pixels lie at the same edge of the picture.
bool alongSameEdge(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                   const Projection& projection) {
  const double near = VIEW_EDGE * projection.width;
  const auto both = [&](int axis, double from, double to) {
    return std::min(a[axis], b[axis]) >= from && std::max(a[axis], b[axis]) <= to;
  };
  constexpr double FAR = std::numeric_limits<double>::infinity();
  return both(0, -FAR, near) || both(0, projection.width - near, FAR) || both(1, -FAR, near) ||
         both(1, projection.height - near, FAR);
}

}  // namespace

Found<Table> tableOnPlane(const Cloud& cloud, const Cloud& sample, const Eigen::Vector4d& plane,
                          double reach, const Eigen::Vector3d& forward,
                          const std::optional<Eigen::Vector3d>& up, const TableOptions& options) {
  auto fit = fitPlaneNear(sample, plane, reach);
  // Table and the foot of what stands on it share the band of `distance`; within three standard
  // deviations the table is nearly alone.
  const double band =
      fit ? std::clamp(3 * fit->rms, options.distance / 4, options.distance) : options.distance;
  if (fit) fit = fitPlaneNear(sample, fit->plane, band);
  if (fit) fit = fitPlaneNear(cloud, fit->plane, band);
  if (!fit) return Found<Table>::none("a plane of fewer than 3 points");
  // The free side is where up points or, when up is not known, where the camera is.
  const double free_side = up ? fit->plane.head<3>().dot(*up) : fit->plane[3];
  if (free_side < 0) fit->plane = -fit->plane;

  Table table;
  table.plane = fit->plane;
  table.rms = fit->rms;
  table.T_camera_table = frameOnPlane(table.plane, forward);
  const auto rows =
      rowsOf(PlaneRaster(cloud, table.T_camera_table, options.distance, PATCH_CELL, MAX_CELLS));
  table.hull = convexHullOf(outlineOf(cloud, rows, table.T_camera_table));
  if (table.hull.empty()) return Found<Table>::none("a plane whose points lie on one line");
  table.inliers = pointsOfTable(cloud, rows, table, options.distance);
  const Eigen::Vector2d center = centroidOfPolygon(table.hull);
  for (auto& corner : table.hull) corner -= center;
  table.T_camera_table.translate(Eigen::Vector3d(center.x(), center.y(), 0));
  return table;
}

std::vector<Eigen::Vector2d> hullBeyondView(const Table& table, const Projection& projection) {
  std::vector<Eigen::Vector2d> pixels;
  for (const auto& corner : hullInCamera(table)) pixels.push_back(projection.pixel(corner));
  std::vector<Eigen::Vector2f> grown;
  for (std::size_t i = 0; i < table.hull.size(); ++i) {
    const std::size_t next = (i + 1) % table.hull.size();
    const Eigen::Vector2d &a = table.hull[i], &b = table.hull[next];
    grown.push_back(a.cast<float>());
    if (!alongSameEdge(pixels[i], pixels[next], projection)) continue;
    const Eigen::Vector2d outwards = Eigen::Vector2d(b.y() - a.y(), a.x() - b.x()).normalized();
    for (const auto& end : {a, b}) grown.push_back((end + BEYOND_VIEW * outwards).cast<float>());
  }
  return convexHullOf(grown);
}

}  // namespace tabletop_perception
