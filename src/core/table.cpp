#include "tabletop_perception/table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <random>

#include <opencv2/imgproc.hpp>

#include "convex_hull.h"
#include "plane_fit.h"

namespace tabletop_perception {
namespace {

constexpr int SAMPLE_SIZE = 1000;         // points that RANSAC looks at
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

/// Points spread evenly over the cloud, in its order.
Cloud sampleOf(const Cloud& cloud) {
  const Indices valid = validIndices(cloud);
  const std::size_t step = std::max<std::size_t>(1, valid.size() / SAMPLE_SIZE);
  Indices sample;
  for (std::size_t i = step / 2; i < valid.size(); i += step) sample.push_back(valid[i]);
  return selectPoints(cloud, sample);
}

/// The points farther than `distance` from a plane.
Cloud withoutPlane(const Cloud& sample, const Eigen::Vector4d& plane, double distance) {
  Indices rest;
  for (std::size_t i = 0; i < sample.size(); ++i)
    if (std::abs(plane.head<3>().dot(sample.point(i).cast<double>()) + plane[3]) > distance)
      rest.push_back(static_cast<int>(i));
  return selectPoints(sample, rest);
}

/// Mean viewing ray of a cloud: forward, whatever the camera's convention.
Eigen::Vector3d forwardOf(const Cloud& sample) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < sample.size(); ++i)
    sum += sample.point(i).cast<double>().normalized();
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

/// The connected patches of a table among points of its plane. Objects and their shadows cut one
/// table into several; a plane also meets, by chance, a few points of other things.
class TablePatches {
 public:
  explicit TablePatches(const std::vector<Eigen::Vector2f>& flat) {
    low_ = flat.front();
    Eigen::Vector2f high = low_;
    for (const auto& p : flat) {
      low_ = low_.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    const float cell = std::max<float>(PATCH_CELL, (high - low_).maxCoeff() / MAX_CELLS);
    cells_per_metre_ = 1 / cell;
    const cv::Point last = cellOf(high);
    cv::Mat1b occupied = cv::Mat1b::zeros(last.y + 1, last.x + 1);
    for (const auto& p : flat) occupied(cellOf(p)) = 1;
    cv::dilate(occupied, occupied, cv::Mat1b::ones(PATCH_GAP + 1, PATCH_GAP + 1));

    std::vector<int> counts(cv::connectedComponents(occupied, patches_, 8, CV_32S));
    for (const auto& p : flat) ++counts[patches_(cellOf(p))];
    const double least = MIN_PATCH_SHARE * *std::max_element(counts.begin(), counts.end());
    for (const int count : counts) kept_.push_back(count >= least);
  }

  bool contains(const Eigen::Vector2f& p) const { return kept_[patches_(cellOf(p))]; }

 private:
  cv::Point cellOf(const Eigen::Vector2f& p) const {
    return {static_cast<int>((p.x() - low_.x()) * cells_per_metre_),
            static_cast<int>((p.y() - low_.y()) * cells_per_metre_)};
  }

  Eigen::Vector2f low_;
  float cells_per_metre_ = 0;
  cv::Mat1i patches_;
  std::vector<bool> kept_;
};

/// The first and the last of the given points in each row of an organised cloud that lie in a
/// patch; of an unorganised cloud all that do. A row of pixels is a line on the plane, so no other
/// point can be a corner of the hull.
std::vector<Eigen::Vector2f> outlineOf(const Cloud& cloud, const Indices& indices,
                                       const std::vector<Eigen::Vector2f>& flat,
                                       const TablePatches& patches) {
  std::vector<Eigen::Vector2f> outline;
  std::size_t begin = 0;
  while (begin < indices.size()) {
    std::size_t end = begin + 1;
    if (cloud.organized()) {
      const int next_row = (indices[begin] / cloud.width + 1) * cloud.width;
      const auto from = indices.begin() + static_cast<std::ptrdiff_t>(begin);
      end = std::lower_bound(from, indices.end(), next_row) - indices.begin();
    }
    std::size_t first = begin, last = end - 1;
    while (first < end && !patches.contains(flat[first])) ++first;
    while (last > first && !patches.contains(flat[last])) --last;
    if (first < end) outline.push_back(flat[first]);
    if (last > first) outline.push_back(flat[last]);
    begin = end;
  }
  return outline;
}

/// The table on a plane that RANSAC drew: refitted to all its points, their patches outlined.
Found<Table> tableOnPlane(const Cloud& cloud, const Eigen::Vector4d& drawn,
                          const Eigen::Vector3d& forward, const std::optional<Eigen::Vector3d>& up,
                          const TableOptions& options) {
  auto fit = fitPlaneNear(cloud, drawn, options.distance);
  // Table and the foot of what stands on it share the band of `distance`; within three standard
  // deviations the table is nearly alone.
  const double band =
      fit ? std::clamp(3 * fit->rms, options.distance / 4, options.distance) : options.distance;
  for (int round = 0; round < 2 && fit; ++round) fit = fitPlaneNear(cloud, fit->plane, band);
  if (!fit) return Found<Table>::none("a plane of fewer than 3 points");
  // The free side is where up points or, when up is not known, where the camera is.
  const double free_side = up ? fit->plane.head<3>().dot(*up) : fit->plane[3];
  if (free_side < 0) fit->plane = -fit->plane;

  Table table;
  table.plane = fit->plane;
  table.rms = fit->rms;
  table.T_camera_table = frameOnPlane(table.plane, forward);
  const Flattener flatten(table.T_camera_table);
  const Indices near = pointsNearPlane(cloud, table.plane, options.distance);
  std::vector<Eigen::Vector2f> flat;
  flat.reserve(near.size());
  for (const int i : near) flat.push_back(flatten(cloud, i));
  table.hull = convexHullOf(outlineOf(cloud, near, flat, TablePatches(flat)));
  if (table.hull.empty()) return Found<Table>::none("a plane whose points lie on one line");

  const ConvexRegion region(table.hull, HULL_SLACK);
  for (std::size_t k = 0; k < near.size(); ++k)
    if (region.contains(flat[k].x(), flat[k].y())) table.inliers.push_back(near[k]);
  const Eigen::Vector2d center = centroidOfPolygon(table.hull);
  for (auto& corner : table.hull) corner -= center;
  table.T_camera_table.translate(Eigen::Vector3d(center.x(), center.y(), 0));
  return table;
}

/// Why a plane cannot be the table; empty if it can.
std::string refusal(const Table& table, const std::optional<Eigen::Vector3d>& up,
                    const TableOptions& options) {
  const int points = static_cast<int>(table.inliers.size());
  if (points < options.min_points)
    return format("largest plane has %d points, limit %d", points, options.min_points);
  if (!up) return "";
  const double cosine = std::clamp(table.plane.head<3>().dot(*up), -1.0, 1.0);
  const double tilt = std::acos(cosine) * 180 / M_PI;
  if (tilt > options.max_tilt_deg)
    return format("largest plane is %.0f deg from up, limit %.0f", tilt, options.max_tilt_deg);
  const double height = table.T_camera_table.translation().dot(*up);
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

Cloud withoutPoints(Cloud cloud, const Indices& indices) {
  for (const int i : indices) cloud.drop(i);
  return cloud;
}

bool carriesSomething(const Cloud& cloud, const Table& table, const TableOptions& options) {
  const StandingTest stands(table, options);
  std::size_t carried = 0;
  for (std::size_t i = 0; i < cloud.size(); i += CARRIED_STEP) carried += stands(cloud, i);
  return carried * CARRIED_STEP >= static_cast<std::size_t>(options.min_carried);
}

}  // namespace

std::vector<Eigen::Vector3d> hullInCamera(const Table& table) {
  std::vector<Eigen::Vector3d> corners;
  for (const auto& corner : table.hull)
    corners.push_back(table.T_camera_table * Eigen::Vector3d(corner.x(), corner.y(), 0));
  return corners;
}

Found<Table> findTable(const Cloud& cloud, const std::optional<Eigen::Vector3d>& up,
                       const TableOptions& options) {
  checkOptions("table", options);
  Cloud sample = sampleOf(cloud);
  if (sample.empty()) return Found<Table>::none("the cloud has no valid point");
  const Eigen::Vector3d forward = forwardOf(sample);
  std::optional<PlaneConstraint> level;
  if (up) level = PlaneConstraint{*up, std::cos(options.max_tilt_deg * M_PI / 180)};
  std::mt19937 random(static_cast<std::uint32_t>(options.seed));

  std::string first_refusal;
  std::optional<Table> bare;
  const Cloud* looked_at = &cloud;
  Cloud rest;  // what the planes before leave over: no point belongs to two
  for (int i = 0; i < options.max_planes; ++i) {
    // The first plane is drawn without regard to up: if no table is found, it is the reason.
    const auto drawn = drawPlane(sample, options.distance, i == 0 ? std::nullopt : level, random);
    if (!drawn) break;
    auto table = tableOnPlane(*looked_at, *drawn, forward, up, options);
    const std::string why = table ? refusal(*table, up, options) : table.reason;
    if (why.empty()) {
      if (carriesSomething(cloud, *table, options)) return table;
      if (!bare) bare = table.value;
    } else if (first_refusal.empty()) {
      first_refusal = why;
    }
    const Eigen::Vector4d& plane = table ? table->plane : *drawn;
    rest = withoutPoints(*looked_at, pointsNearPlane(*looked_at, plane, options.distance));
    looked_at = &rest;
    sample = withoutPlane(sample, plane, 1.5 * options.distance);
  }
  if (bare) {
    Found<Table> found(*bare);
    found.reason = "nothing stands on it";
    return found;
  }
  return Found<Table>::none(first_refusal.empty() ? "no plane" : first_refusal);
}

Cloud pointsOnTable(const Cloud& cloud, const Table& table, const TableOptions& options) {
  const StandingTest stands(table, options);
  Cloud standing(cloud.width, cloud.height, false);
  standing.rgb = cloud.rgb;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (stands(cloud, i)) standing.setPoint(i, cloud.point(i));
  return standing;
}

}  // namespace tabletop_perception
