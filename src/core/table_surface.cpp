#include "table_surface.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "convex_hull.h"
#include "plane_fit.h"
#include "plane_raster.h"

namespace tabletop_perception {
namespace {

constexpr double PATCH_CELL = 0.02;       // raster in which a patch of table is connected [m]
constexpr int PATCH_GAP = 2;              // cells without points that a patch may span
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

/// What the points in a cell of the raster are. PATCH is 1, as marks are: once strays are decided,
/// kinds are marks.
enum CellKind : std::uint8_t { NO_POINTS = 0, PATCH = 1, STRAY = 2 };

/// The kind of each cell, by a share of the points. The table's points are those of its connected
/// patches, as objects and their shadows cut one table into several; a plane also meets, by chance,
/// a few points of other things.
std::vector<CellKind> kindsOf(const PlaneRaster& raster) {
  const std::vector<int> points = pointsByCell(raster, shareOf(raster.cell.size()));
  cv::Mat1b occupied(raster.rows, raster.columns);
  std::transform(points.begin(), points.end(), occupied.begin(),
                 [](int count) { return static_cast<std::uint8_t>(count > 0); });
  cv::dilate(occupied, occupied, cv::Mat1b::ones(PATCH_GAP + 1, PATCH_GAP + 1));
  cv::Mat1i patches;
  std::vector<int> sizes(cv::connectedComponents(occupied, patches, 8, CV_32S));
  for (std::size_t cell = 0; cell < points.size(); ++cell)
    sizes[patches(static_cast<int>(cell))] += points[cell];
  const double least = MIN_PATCH_SHARE * *std::max_element(sizes.begin(), sizes.end());
  std::vector<CellKind> kinds(points.size(), STRAY);  // also where the share has no point
  for (std::size_t cell = 0; cell < points.size(); ++cell)
    if (points[cell] > 0 && sizes[patches(static_cast<int>(cell))] >= least) kinds[cell] = PATCH;
  kinds[0] = NO_POINTS;
  return kinds;
}

/// The kind of each point's cell.
void lookUp(const int* cell, std::size_t count, const CellKind* kinds, std::uint8_t* kind) {
  for (std::size_t i = 0; i < count; ++i) kind[i] = kinds[cell[i]];
}

/// The first value of that kind from `begin` on; null if there is none.
std::uint8_t* nextOf(CellKind kind, std::uint8_t* begin, std::vector<std::uint8_t>& values) {
  const auto left = static_cast<std::size_t>(values.data() + values.size() - begin);
  return static_cast<std::uint8_t*>(std::memchr(begin, kind, left));
}

/// The first and the last point of a patch in each row of an organised cloud; of an unorganised
/// cloud all of them. A row of pixels is a line on the plane, so no other point can be a corner of
/// the hull.
Indices outlineOf(const Cloud& cloud, const PlaneRaster& raster,
                  const std::vector<CellKind>& kinds) {
  const int length = cloud.organized() ? cloud.width : 1;
  Indices outline;
  for (int begin = 0; begin < static_cast<int>(cloud.size()); begin += length) {
    int first = begin, last = begin + length - 1;
    while (first <= last && kinds[raster.cell[first]] != PATCH) ++first;
    while (last > first && kinds[raster.cell[last]] != PATCH) --last;
    if (first <= last) outline.push_back(first);
    if (first < last) outline.push_back(last);
  }
  return outline;
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
  const PlaneRaster raster =
      rasterOver(cloud, table.T_camera_table, options.distance, PATCH_CELL, MAX_CELLS);
  const auto kinds = kindsOf(raster);
  const Flattener flatten(table.T_camera_table);
  std::vector<Eigen::Vector2f> outline;
  for (const int i : outlineOf(cloud, raster, kinds)) outline.push_back(flatten(cloud, i));
  table.hull = convexHullOf(outline);
  if (table.hull.empty()) return Found<Table>::none("a plane whose points lie on one line");

  std::vector<std::uint8_t> on_table(cloud.size());
  lookUp(raster.cell.data(), cloud.size(), kinds.data(), on_table.data());
  const ConvexRegion region(table.hull, HULL_SLACK);
  for (auto* stray = on_table.data(); (stray = nextOf(STRAY, stray, on_table)) != nullptr;) {
    const Eigen::Vector2f p = flatten(cloud, static_cast<std::size_t>(stray - on_table.data()));
    *stray = region.contains(p.x(), p.y());
  }
  table.inliers = indicesOf(on_table);
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
