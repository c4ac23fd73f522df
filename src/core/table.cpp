#include "tabletop_perception/table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <iterator>

#include <opencv2/imgproc.hpp>

#include "convex_hull.h"
#include "plane_fit.h"
#include "plane_raster.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/planes.h"

namespace tabletop_perception {
namespace {

constexpr int SAMPLE_SIZE = 1000;         // points that a plane is fitted to at first
constexpr int NORMAL_SAMPLE_SIZE = 1500;  // points of an unorganised cloud that have normals
constexpr int COARSE_COLUMNS = 160;       // of the grid on which planes are connected
constexpr double LEVEL_COSINE = 0.996;    // of 5 deg: pieces of one level tilt alike
constexpr double COARSE_TILT_DEG = 2;     // of a plane on that grid from that of all points [deg]
constexpr double MAX_SHARED = 0.25;       // of a table's points with one before it
constexpr double MIN_OTHER_SHARE = 0.25;  // of the main table's points, for another one
constexpr double PATCH_CELL = 0.02;       // raster in which a patch of table is connected [m]
constexpr int PATCH_GAP = 2;              // cells without points that a patch may span
constexpr double MIN_PATCH_SHARE = 0.05;  // of the largest patch: smaller ones are chance
constexpr int MAX_CELLS = 2000;           // along one side of the raster
constexpr double HULL_SLACK = 0.005;  // the hull's own corners lie on the table, noise or not [m]
constexpr std::size_t CARRIED_STEP = 7;  // every so manieth point tells whether a table is bare

std::string format(const char* text, ...) __attribute__((format(printf, 1, 2)));
std::string format(const char* text, ...) {
  char line[256];
  va_list values;
  va_start(values, text);
  std::vsnprintf(line, sizeof line, text, values);
  va_end(values);
  return line;
}

/// Every few pixels of an organised cloud, about COARSE_COLUMNS in a row.
Cloud coarseGridOf(const Cloud& cloud) {
  const int step = std::max(1, (cloud.width + COARSE_COLUMNS / 2) / COARSE_COLUMNS);
  Cloud coarse((cloud.width + step - 1) / step, (cloud.height + step - 1) / step, false);
  for (int row = 0; row < coarse.height; ++row)
    for (int column = 0; column < coarse.width; ++column)
      coarse.setPoint(row * coarse.width + column,
                      cloud.point(row * step * cloud.width + column * step));
  return coarse;
}

/// Mean viewing ray of a cloud: forward, whatever the camera's convention.
Eigen::Vector3d forwardOf(const Cloud& sample) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < sample.size(); ++i)
    if (sample.valid(i)) sum += sample.point(i).cast<double>().normalized();
  return sum.norm() > 0 ? Eigen::Vector3d(sum.normalized()) : Eigen::Vector3d::UnitZ();
}

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

/// x and y of points in a frame on a plane.
class Flattener {
 public:
  explicit Flattener(const Eigen::Isometry3d& T_camera_plane)
      : to_plane_((T_camera_plane.inverse().matrix().topRows<2>()).cast<float>()) {}

  Eigen::Vector2f operator()(const Cloud& cloud, std::size_t i) const {
    return to_plane_.leftCols<3>() * cloud.point(i) + to_plane_.col(3);
  }

 private:
  Eigen::Matrix<float, 2, 4> to_plane_;
};

/// What the points in a cell of the raster are.
enum CellKind : std::uint8_t { NO_POINTS, PATCH, STRAY };

/// The kind of each cell. The table's points are those of its connected patches, as objects and
/// their shadows cut one table into several; a plane also meets, by chance, a few points of other
/// things.
std::vector<CellKind> kindsOf(const PlaneRaster& raster) {
  const std::vector<int> points = pointsByCell(raster);
  cv::Mat1b occupied(raster.rows, raster.columns);
  std::transform(points.begin(), points.end(), occupied.begin(),
                 [](int count) { return static_cast<std::uint8_t>(count > 0); });
  cv::dilate(occupied, occupied, cv::Mat1b::ones(PATCH_GAP + 1, PATCH_GAP + 1));
  cv::Mat1i patches;
  std::vector<int> sizes(cv::connectedComponents(occupied, patches, 8, CV_32S));
  for (std::size_t cell = 0; cell < points.size(); ++cell)
    sizes[patches(static_cast<int>(cell))] += points[cell];
  const double least = MIN_PATCH_SHARE * *std::max_element(sizes.begin(), sizes.end());
  std::vector<CellKind> kinds(points.size(), NO_POINTS);
  for (std::size_t cell = 0; cell < points.size(); ++cell)
    if (points[cell] > 0)
      kinds[cell] = sizes[patches(static_cast<int>(cell))] >= least ? PATCH : STRAY;
  return kinds;
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

/// The table on a plane that was found: fitted again to the points within `reach` [m] of it, first
/// to a sample, then to all, their patches outlined.
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

  const ConvexRegion region(table.hull, HULL_SLACK);
  table.inliers.resize(cloud.size());
  std::size_t count = 0;
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
    const CellKind kind = kinds[raster.cell[i]];
    table.inliers[count] = i;  // kept only if the next lines count it
    count += kind == PATCH;
    if (kind != STRAY) continue;
    const Eigen::Vector2f p = flatten(cloud, i);
    count += region.contains(p.x(), p.y());
  }
  table.inliers.resize(count);
  const Eigen::Vector2d center = centroidOfPolygon(table.hull);
  for (auto& corner : table.hull) corner -= center;
  table.T_camera_table.translate(Eigen::Vector3d(center.x(), center.y(), 0));
  return table;
}

/// Angle between a plane's normal and up [deg].
double tiltOf(const Eigen::Vector4d& plane, const Eigen::Vector3d& up) {
  return std::acos(std::clamp(plane.head<3>().dot(up), -1.0, 1.0)) * 180 / M_PI;
}

/// Why a plane cannot be the table; empty if it can. `agreement`: of its points' normals with it.
std::string refusal(const Table& table, double agreement, const std::optional<Eigen::Vector3d>& up,
                    const TableOptions& options) {
  const int points = static_cast<int>(table.inliers.size());
  if (points < options.min_points)
    return format("largest plane has %d points, limit %d", points, options.min_points);
  if (agreement < MIN_NORMAL_AGREEMENT)
    return format("largest plane cuts through things: %.0f %% of its normals agree, limit %.0f",
                  100 * agreement, 100 * MIN_NORMAL_AGREEMENT);
  if (!up) return "";
  const double tilt = tiltOf(table.plane, *up);
  if (tilt > options.max_tilt_deg)
    return format("largest plane is %.0f deg from up, limit %.0f", tilt, options.max_tilt_deg);
  const double height = table.T_camera_table.translation().dot(*up);
  if (table.plane[3] < 0)
    return format("largest level plane is at height %.2f m, seen from below", height);
  if (options.use_height_band &&
      (height < options.min_table_height || height > options.max_table_height))
    return format("largest level plane is at height %.2f m, limits %.2f to %.2f", height,
                  options.min_table_height, options.max_table_height);
  return "";
}

/// Tells which points stand on a table.
class StandingTest {
 public:
  StandingTest(const Table& table, const TableOptions& options)
      : plane_(table.plane.cast<float>()),
        low_(static_cast<float>(options.min_height)),
        high_(static_cast<float>(options.max_height)),
        flatten_(table.T_camera_table),
        region_(table.hull, options.hull_margin) {}

  bool operator()(const Cloud& cloud, std::size_t i) const {
    const float height =
        plane_[0] * cloud.x[i] + plane_[1] * cloud.y[i] + plane_[2] * cloud.z[i] + plane_[3];
    if (!(height >= low_ && height <= high_)) return false;  // NaN too
    const Eigen::Vector2f p = flatten_(cloud, i);
    return region_.contains(p.x(), p.y());
  }

 private:
  Eigen::Vector4f plane_;
  float low_, high_;
  Flattener flatten_;
  ConvexRegion region_;
};

bool carriesSomething(const Cloud& cloud, const Table& table, const TableOptions& options) {
  const StandingTest stands(table, options);
  std::size_t carried = 0;
  for (std::size_t i = 0; i < cloud.size(); i += CARRIED_STEP) {
    carried += stands(cloud, i);
    if (carried * CARRIED_STEP >= static_cast<std::size_t>(options.min_carried)) return true;
  }
  return false;
}

/// Some points of a cloud with their normals: enough to see where it is flat.
struct NormalSample {
  Cloud cloud;
  Normals normals;

  explicit NormalSample(const Cloud& whole)
      : cloud(whole.organized() ? coarseGridOf(whole) : samplePoints(whole, NORMAL_SAMPLE_SIZE)),
        normals(computeNormals(cloud, Eigen::Vector3f::Zero(), normalsOptions())) {}

 private:
  static NormalsOptions normalsOptions() {
    NormalsOptions options;
    options.step = 1;        // the grid is coarse as it is
    options.neighbors = 10;  // of a thin sample: more would reach beyond the surface
    return options;
  }
};

/// Planes of which several, alike in tilt and level, are one surface that things cut apart.
std::vector<Plane> levelsOf(const Cloud& cloud, const std::vector<Plane>& planes, double gap) {
  std::vector<Plane> levels;
  for (const auto& plane : planes) {
    const auto same = std::find_if(levels.begin(), levels.end(), [&](const Plane& level) {
      const Eigen::Vector3d normal = level.plane.head<3>();
      return normal.dot(plane.plane.head<3>()) >= LEVEL_COSINE &&
             std::abs(normal.dot(plane.centroid) + level.plane[3]) <= gap;
    });
    if (same == levels.end())
      levels.push_back(plane);
    else
      *same = mergedPlane(cloud, *same, plane);
  }
  std::stable_sort(levels.begin(), levels.end(), [](const Plane& a, const Plane& b) {
    return a.points.size() > b.points.size();
  });
  return levels;
}

/// Looks at planes, one after the other, and keeps those that are tables, or why none is.
class TableSearch {
 public:
  TableSearch(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
              const TableOptions& options, std::size_t most)
      : cloud_(cloud),
        up_(up),
        options_(options),
        most_(most),
        sample_(cloud),
        forward_(forwardOf(sample_.cloud)) {}

  void amongComponents() {
    const auto planes = findPlanes(sample_.cloud, sample_.normals, PlaneOptions());
    int looked_at = 0;
    for (const auto& level : levelsOf(sample_.cloud, planes, options_.level_gap)) {
      if (looked_at == options_.max_planes || done()) return;
      // The largest is looked at even if it cannot be a table: then it is the reason.
      if (looked_at > 0 && !mayBeLevel(level.plane)) continue;
      ++looked_at;
      const double reach = std::clamp(3 * level.rms, options_.distance / 4, options_.distance);
      lookAt(cloud_, sample_.cloud, level.plane, reach);
    }
  }

  void byDrawing() {
    std::optional<PlaneConstraint> level;
    if (up_) level = PlaneConstraint{*up_, std::cos(options_.max_tilt_deg * M_PI / 180)};
    Cloud rest = cloud_;  // what the planes before leave over: no point belongs to two
    for (int i = 0; i < options_.max_planes; ++i) {
      // The first plane is found without regard to up: if no table is found, it is the reason.
      const auto plane = findLargestPlane(rest, options_.distance, i == 0 ? std::nullopt : level,
                                          static_cast<std::uint32_t>(options_.seed + i));
      if (!plane) return;
      lookAt(rest, samplePoints(rest, SAMPLE_SIZE), plane->plane, options_.distance);
      if (done()) return;
      for (const int point : plane->points) rest.drop(point);
    }
  }

  Found<std::vector<Table>> result() && {
    if (!tables_.empty()) return std::move(tables_);
    if (!bare_) return Found<std::vector<Table>>::none(refusal_.empty() ? "no plane" : refusal_);
    Found<std::vector<Table>> found({std::move(*bare_)});
    found.reason = "nothing stands on it";
    return found;
  }

 private:
  bool done() const { return tables_.size() == most_; }

  /// A coarse plane tilts a little otherwise than that of all points.
  bool mayBeLevel(const Eigen::Vector4d& plane) const {
    if (!up_) return true;
    const double tilt = tiltOf(plane, *up_);
    return std::min(tilt, 180 - tilt) <= options_.max_tilt_deg + COARSE_TILT_DEG;
  }

  void lookAt(const Cloud& cloud, const Cloud& sample, const Eigen::Vector4d& plane, double reach) {
    auto table = tableOnPlane(cloud, sample, plane, reach, forward_, up_, options_);
    const std::string why =
        table ? refusal(*table, agreementOf(*table), up_, options_) : table.reason;
    if (!why.empty()) {
      if (refusal_.empty()) refusal_ = why;
    } else if (carriesSomething(cloud_, *table, options_)) {
      if (isAnother(*table)) tables_.push_back(std::move(*table.value));
    } else if (!bare_) {
      bare_ = std::move(table.value);
    }
  }

  /// Not a piece of a table before, nor the lid of a thing on it.
  bool isAnother(const Table& table) const {
    const double points = static_cast<double>(table.inliers.size());
    if (!tables_.empty() && points < MIN_OTHER_SHARE * tables_.front().inliers.size()) return false;
    return std::none_of(tables_.begin(), tables_.end(), [&](const Table& before) {
      Indices shared;
      std::set_intersection(before.inliers.begin(), before.inliers.end(), table.inliers.begin(),
                            table.inliers.end(), std::back_inserter(shared));
      return shared.size() > MAX_SHARED * points;
    });
  }

  double agreementOf(const Table& table) const {
    const Indices near = pointsNearPlane(sample_.cloud, table.plane, options_.distance);
    return normalAgreement(sample_.normals, near, table.plane.head<3>());
  }

  const Cloud& cloud_;
  const std::optional<Eigen::Vector3d>& up_;
  const TableOptions& options_;
  std::size_t most_;
  NormalSample sample_;
  Eigen::Vector3d forward_;
  std::vector<Table> tables_;
  std::optional<Table> bare_;  // the largest that carries nothing
  std::string refusal_;        // of the largest
};

Found<std::vector<Table>> tablesOf(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                                   const TableOptions& options, std::size_t most) {
  checkOptions("table", options);
  if (std::all_of(cloud.x.begin(), cloud.x.end(), [](float x) { return std::isnan(x); }))
    return Found<std::vector<Table>>::none("the cloud has no valid point");
  TableSearch search(cloud, up, options, most);
  if (options.method == "components" && cloud.organized())
    search.amongComponents();
  else
    search.byDrawing();
  return std::move(search).result();
}

}  // namespace

std::vector<Eigen::Vector3d> hullInCamera(const Table& table) {
  std::vector<Eigen::Vector3d> corners;
  for (const auto& corner : table.hull)
    corners.push_back(table.T_camera_table * Eigen::Vector3d(corner.x(), corner.y(), 0));
  return corners;
}

Found<std::vector<Table>> findTables(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                                     const TableOptions& options) {
  return tablesOf(cloud, up, options, options.max_planes);
}

Found<Table> findTable(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                       const TableOptions& options) {
  auto tables = tablesOf(cloud, up, options, 1);
  if (!tables) return Found<Table>::none(tables.reason);
  Found<Table> found(std::move(tables.value->front()));
  found.reason = tables.reason;
  return found;
}

Cloud pointsOnTable(const Cloud& cloud, const Table& table, const TableOptions& options) {
  return keepPoints(cloud, indicesOnTable(cloud, table, options));
}

Indices indicesOnTable(const Cloud& cloud, const Table& table, const TableOptions& options) {
  const Flattener flatten(table.T_camera_table);
  const ConvexRegion region(table.hull, options.hull_margin);
  Indices standing = pointsBetween(cloud, table.plane, options.min_height, options.max_height);
  std::size_t count = 0;
  for (const int i : standing) {
    const Eigen::Vector2f p = flatten(cloud, i);
    standing[count] = i;  // kept only if the next line counts it
    count += region.contains(p.x(), p.y());
  }
  standing.resize(count);
  return standing;
}

}  // namespace tabletop_perception
