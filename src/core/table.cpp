#include "tabletop_perception/table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>

#include "convex_hull.h"
#include "format.h"
#include "plane_fit.h"
#include "table_surface.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/planes.h"
#include "tabletop_perception/projection.h"

namespace tabletop_perception {
namespace {

constexpr int SAMPLE_SIZE = 1000;          // points that a plane is fitted to at first
constexpr int NORMAL_SAMPLE_SIZE = 1500;   // points of an unorganised cloud that have normals
constexpr int COARSE_COLUMNS = 107;        // of the grid on which planes are connected
constexpr double LEVEL_COSINE = 0.996;     // of 5 deg: pieces of one level tilt alike
constexpr double COARSE_TILT_DEG = 2;      // of a plane on that grid from that of all points [deg]
constexpr double MAX_SHARED = 0.25;        // of a table's points with one before it
constexpr double MIN_OTHER_SHARE = 0.25;   // of the largest table's points, for another one
constexpr double RIM_FACTOR = 2;           // coarse planes lack their rims: at most half of them
constexpr double MAX_OTHER_TILT_DEG = 10;  // of another table from the largest [deg]
constexpr double MIN_OVER_SHARE = 0.25;    // of a thing's top: things hide their table
constexpr double MIN_CLEARANCE = 0.1;      // under a board, above another one: lower is a thing [m]
constexpr double BOARD_THICKNESS = 0.04;   // of a table: so far below its surface it is itself [m]
constexpr double EDGE_REACH = 0.01;        // how far outside the hull a board's edges may lie [m]
constexpr double SIDE_CELL = 0.02;         // raster in which a thing's sides are looked for [m]
constexpr double SIDE_REACH = 0.03;        // how far from the outline of its top they may lie [m]
constexpr double MIN_SIDE_SHARE = 0.3;     // of the outline with sides below: the top of a thing
constexpr std::size_t FORWARD_STEP = 7;    // every so manieth point tells where the camera looks
constexpr std::size_t FEW_STEP = 997;      // every so manieth point tells whether there is any
constexpr std::size_t CARRIED_STEP = 7;    // every so manieth point tells whether a table is bare

/// Every few pixels of an organised cloud, about COARSE_COLUMNS in a row.
Cloud coarseGridOf(const Cloud& cloud) {
  return decimated(cloud, std::max(1, (cloud.width + COARSE_COLUMNS / 2) / COARSE_COLUMNS));
}

/// Whether a cloud has any valid point. A few are asked first, from all over it.
bool hasPoint(const Cloud& cloud) {
  for (std::size_t i = 0; i < cloud.size(); i += FEW_STEP)
    if (cloud.valid(i)) return true;
  return std::any_of(cloud.x.begin(), cloud.x.end(), [](float x) { return !std::isnan(x); });
}

/// Mean viewing ray of a cloud: forward, whatever the camera's convention.
Eigen::Vector3d forwardOf(const Cloud& sample) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < sample.size(); i += FORWARD_STEP)
    if (sample.valid(i)) sum += sample.point(i).cast<double>().normalized();
  return sum.norm() > 0 ? Eigen::Vector3d(sum.normalized()) : Eigen::Vector3d::UnitZ();
}

double cosineOf(double degrees) { return std::cos(degrees * M_PI / 180); }

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

/// Heights over a table, and a margin about its hull [m].
struct Column {
  double low, high, margin;
};

/// Where things stand on a table.
Column standingColumn(const TableOptions& options) {
  return {options.min_height, options.max_height, options.hull_margin};
}

/// Tells, point by point, which lie in a column over a table.
class ColumnTest {
 public:
  ColumnTest(const Table& table, const Column& column)
      : plane_(table.plane.cast<float>()),
        low_(static_cast<float>(column.low)),
        high_(static_cast<float>(column.high)),
        flatten_(table.T_camera_table),
        region_(table.hull, column.margin) {}

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

/// All points that lie in a column over an outline on a table: heights first, many at once.
Indices pointsOver(const Cloud& cloud, const Table& table,
                   const std::vector<Eigen::Vector2d>& outline, const Column& column) {
  const Flattener flatten(table.T_camera_table);
  const ConvexRegion region(outline, column.margin);
  Indices over = pointsBetween(cloud, table.plane, column.low, column.high);
  std::size_t count = 0;
  for (const int i : over) {
    const Eigen::Vector2f p = flatten(cloud, i);
    over[count] = i;  // kept only if the next line counts it
    count += region.contains(p.x(), p.y());
  }
  over.resize(count);
  return over;
}

bool carriesSomething(const Cloud& cloud, const Table& table, const TableOptions& options) {
  const ColumnTest stands(table, standingColumn(options));
  std::size_t carried = 0;
  for (std::size_t i = 0; i < cloud.size(); i += CARRIED_STEP) {
    carried += stands(cloud, i);
    if (carried * CARRIED_STEP >= static_cast<std::size_t>(options.min_carried)) return true;
  }
  return false;
}

/// Whether a plane is the top of a thing on a table, not a board above it: some of its points,
/// `top` of the cloud, stand on the table, and beneath them are the thing's sides. Under a board is
/// air, seen from the side, whatever else stands there.
bool isTopOfThing(const Cloud& cloud, const Indices& top, const Table& table,
                  const TableOptions& options) {
  const ColumnTest stands(table, standingColumn(options));
  const Flattener flatten(table.T_camera_table);
  struct Extent {
    float from = std::numeric_limits<float>::infinity(), to = -from;
    bool has_side = false;
  };
  std::map<int, Extent> slices;  // of the top, across the camera's forward direction
  const auto sliceOf = [](const Eigen::Vector2f& p) {
    return static_cast<int>(std::floor(p.y() / static_cast<float>(SIDE_CELL)));
  };
  std::size_t standing = 0;
  double height = 0;
  for (const int i : top) {
    if (!stands(cloud, i)) continue;
    ++standing;
    height += heightAbove(table, cloud.point(i));
    const Eigen::Vector2f p = flatten(cloud, i);
    Extent& slice = slices[sliceOf(p)];
    slice.from = std::min(slice.from, p.x() - static_cast<float>(SIDE_REACH));
    slice.to = std::max(slice.to, p.x() + static_cast<float>(SIDE_REACH));
  }
  if (static_cast<double>(standing) < MIN_OVER_SHARE * static_cast<double>(top.size()))
    return false;
  height /= static_cast<double>(standing);
  if (height < MIN_CLEARANCE) return true;

  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!stands(cloud, i)) continue;
    const double below = height - heightAbove(table, cloud.point(i));
    if (below < BOARD_THICKNESS || below > height / 2) continue;
    const Eigen::Vector2f p = flatten(cloud, i);
    const auto slice = slices.find(sliceOf(p));
    if (slice != slices.end() && p.x() >= slice->second.from && p.x() <= slice->second.to)
      slice->second.has_side = true;
  }
  const auto sides = std::count_if(slices.begin(), slices.end(),
                                   [](const auto& slice) { return slice.second.has_side; });
  return static_cast<double>(sides) >= MIN_SIDE_SHARE * static_cast<double>(slices.size());
}

/// Whether a table about `center` stands over another one, as over the floor: higher than things on
/// it may be. The nearest floor in view may begin behind the table, by about its height.
bool isBelow(const Table& lower, const Eigen::Vector3f& center, const TableOptions& options) {
  const double height = heightAbove(lower, center);
  return height > options.max_height && isOver(lower, center, height);
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
    options.window = 5;      // on it, wider than the default one
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
              const TableOptions& options)
      : cloud_(cloud),
        up_(up),
        options_(options),
        sample_(cloud),
        forward_(forwardOf(sample_.cloud)) {}

  void amongComponents() {
    const auto planes = findPlanes(sample_.cloud, sample_.normals, PlaneOptions());
    int looked_at = 0;
    for (const auto& level : levelsOf(sample_.cloud, planes, options_.level_gap)) {
      if (looked_at == options_.max_planes) return;
      // The largest is looked at even if it cannot be a table: then it is the reason.
      if (looked_at > 0 && !mayBeLevel(level.plane)) continue;
      const double points = RIM_FACTOR * static_cast<double>(level.points.size()) *
                            static_cast<double>(cloud_.size()) /
                            static_cast<double>(sample_.cloud.size());
      if (!isLargeEnough(points, level.centroid.cast<float>())) continue;
      if (!isNoThing(sample_.cloud, level.points)) continue;
      ++looked_at;
      const double reach = std::clamp(3 * level.rms, options_.distance / 4, options_.distance);
      lookAt(cloud_, sample_.cloud, level.plane, reach);
    }
  }

  void byDrawing() {
    Cloud rest = cloud_;  // what the planes before leave over: no point belongs to two
    for (int i = 0; i < options_.max_planes; ++i) {
      // The first plane is found without regard to up: if no table is found, it is the reason.
      const auto plane =
          findLargestPlane(rest, options_.distance, i == 0 ? std::nullopt : levelPlanes(),
                           static_cast<std::uint32_t>(options_.seed + i));
      if (!plane) return;
      if (!isLargeEnough(static_cast<double>(plane->points.size()), plane->centroid.cast<float>()))
        return;
      if (isNoThing(rest, plane->points))
        lookAt(rest, samplePoints(rest, SAMPLE_SIZE), plane->plane, options_.distance);
      for (const int i : pointsNearPlane(rest, plane->plane, options_.distance)) rest.drop(i);
    }
  }

  Found<std::vector<Table>> result() && {
    if (!tables_.empty()) {
      if (tables_.size() > 1) dropFloors();
      return std::move(tables_);
    }
    if (!bare_) return Found<std::vector<Table>>::none(refusal_.empty() ? "no plane" : refusal_);
    Found<std::vector<Table>> found({std::move(*bare_)});
    found.reason = "nothing stands on it";
    return found;
  }

 private:
  /// A coarse plane tilts a little otherwise than that of all points.
  bool mayBeLevel(const Eigen::Vector4d& plane) const {
    if (!tables_.empty()) return tiltOf(plane, largestNormal()) <= MAX_OTHER_TILT_DEG;
    if (!up_) return true;
    const double tilt = tiltOf(plane, *up_);
    return std::min(tilt, 180 - tilt) <= options_.max_tilt_deg + COARSE_TILT_DEG;
  }

  /// What is to be drawn after the first plane.
  std::optional<PlaneConstraint> levelPlanes() const {
    if (!tables_.empty()) return PlaneConstraint{largestNormal(), cosineOf(MAX_OTHER_TILT_DEG)};
    if (up_) return PlaneConstraint{*up_, cosineOf(options_.max_tilt_deg)};
    return std::nullopt;
  }

  /// Whether so many points about `center`, were they a table, are enough beside the largest table.
  /// Above the floor it may be small.
  bool isLargeEnough(double points, const Eigen::Vector3f& center) const {
    if (tables_.empty()) return true;
    const Table& largest = tables_.front();
    return points >= MIN_OTHER_SHARE * static_cast<double>(largest.inliers.size()) ||
           (points >= options_.min_points && isBelow(largest, center, options_));
  }

  /// Whether a plane through the given points of a cloud is not the top of a thing.
  bool isNoThing(const Cloud& cloud, const Indices& points) const {
    return std::none_of(tables_.begin(), tables_.end(), [&](const Table& table) {
      return isTopOfThing(cloud, points, table, options_);
    });
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

  /// Of a fair size, facing up as the largest does, and not a piece of a table before.
  bool isAnother(const Table& table) const {
    const double points = static_cast<double>(table.inliers.size());
    if (!isLargeEnough(points, centerOf(table))) return false;
    if (!tables_.empty() && largestNormal().dot(table.plane.head<3>()) < 0) return false;
    return std::none_of(tables_.begin(), tables_.end(), [&](const Table& before) {
      Indices shared;
      std::set_intersection(before.inliers.begin(), before.inliers.end(), table.inliers.begin(),
                            table.inliers.end(), std::back_inserter(shared));
      return shared.size() > MAX_SHARED * points;
    });
  }

  /// What a table stands over is the floor.
  void dropFloors() {
    std::vector<Table> tables;
    for (const auto& table : tables_)
      if (std::none_of(tables_.begin(), tables_.end(), [&](const Table& other) {
            return isBelow(table, centerOf(other), options_);
          }))
        tables.push_back(table);
    tables_ = std::move(tables);
  }

  static Eigen::Vector3f centerOf(const Table& table) {
    return table.T_camera_table.translation().cast<float>();
  }

  Eigen::Vector3d largestNormal() const { return tables_.front().plane.head<3>(); }

  double agreementOf(const Table& table) const {
    const Indices near = pointsNearPlane(sample_.cloud, table.plane, options_.distance);
    return normalAgreement(sample_.normals, near, table.plane.head<3>());
  }

  const Cloud& cloud_;
  const std::optional<Eigen::Vector3d>& up_;
  const TableOptions& options_;
  NormalSample sample_;
  Eigen::Vector3d forward_;
  std::vector<Table> tables_;
  std::optional<Table> bare_;  // the largest that carries nothing
  std::string refusal_;        // of the largest
};

}  // namespace

Eigen::Vector3d upOfPitch(double pitch) {
  const double angle = pitch * M_PI / 180;
  return {0, -std::cos(angle), -std::sin(angle)};
}

bool isOver(const Table& table, const Eigen::Vector3f& point, double margin) {
  const Eigen::Vector2f flat =
      (table.T_camera_table.inverse() * point.cast<double>()).head<2>().cast<float>();
  return ConvexRegion(table.hull, margin).contains(flat.x(), flat.y());
}

std::vector<Eigen::Vector3d> hullInCamera(const Table& table) {
  std::vector<Eigen::Vector3d> corners;
  for (const auto& corner : table.hull)
    corners.push_back(table.T_camera_table * Eigen::Vector3d(corner.x(), corner.y(), 0));
  return corners;
}

Found<std::vector<Table>> findTables(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                                     const TableOptions& options) {
  checkOptions("table", options);
  if (!hasPoint(cloud)) return Found<std::vector<Table>>::none("the cloud has no valid point");
  TableSearch search(cloud, up, options);
  if (options.method == "components" && cloud.organized())
    search.amongComponents();
  else
    search.byDrawing();
  return std::move(search).result();
}

Found<Table> findTable(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                       const TableOptions& options) {
  auto tables = findTables(cloud, up, options);
  if (!tables) return Found<Table>::none(tables.reason);
  Found<Table> found(std::move(tables.value->front()));
  found.reason = tables.reason;
  return found;
}

Cloud pointsOnTables(const Cloud& cloud, const std::vector<Table>& tables,
                     const TableOptions& options) {
  return keepPoints(cloud, indicesOnTables(cloud, tables, options));
}

Indices indicesOnTables(const Cloud& cloud, const std::vector<Table>& tables,
                        const TableOptions& options) {
  const auto projection = fitProjection(cloud);
  const auto standingOn = [&](const Table& table) {
    const auto outline = projection ? hullBeyondView(table, *projection) : table.hull;
    return pointsOver(cloud, table, outline, standingColumn(options));
  };
  if (tables.empty()) return {};
  if (tables.size() == 1) return standingOn(tables.front());

  std::vector<bool> stands(cloud.size(), false);
  for (const auto& table : tables)
    for (const int i : standingOn(table)) stands[i] = true;
  for (const auto& table : tables)
    for (const int i :
         pointsOver(cloud, table, table.hull, {-BOARD_THICKNESS, options.min_height, EDGE_REACH}))
      stands[i] = false;
  Indices standing;
  for (std::size_t i = 0; i < stands.size(); ++i)
    if (stands[i]) standing.push_back(static_cast<int>(i));
  return standing;
}

std::size_t tableUnder(const std::vector<Table>& tables, const Eigen::Vector3f& middle) {
  std::size_t under = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < tables.size(); ++t) {
    const double height = heightAbove(tables[t], middle);
    if (height < 0 || height >= least || !isOver(tables[t], middle, 0)) continue;
    under = t;
    least = height;
  }
  return under;
}

}  // namespace tabletop_perception
