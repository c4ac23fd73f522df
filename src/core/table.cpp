#include "tabletop_perception/table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <random>

#include <Eigen/Eigenvalues>
#include <opencv2/imgproc.hpp>

namespace tabletop_perception {
namespace {

constexpr int SAMPLE_SIZE = 1500;         // points that RANSAC looks at
constexpr int MAX_ITERATIONS = 1000;      // of RANSAC
constexpr double CONFIDENCE = 0.999;      // that one of them drew inliers alone
constexpr double PATCH_CELL = 0.02;       // raster in which a patch of table is connected [m]
constexpr int PATCH_GAP = 2;              // cells without points that a patch may span
constexpr double MIN_PATCH_SHARE = 0.05;  // of the largest patch: smaller ones are chance
constexpr int MAX_CELLS = 2000;           // along one side of the raster

std::string format(const char* text, ...) __attribute__((format(printf, 1, 2)));
std::string format(const char* text, ...) {
  char line[256];
  va_list values;
  va_start(values, text);
  std::vsnprintf(line, sizeof line, text, values);
  va_end(values);
  return line;
}

double distanceFrom(const Eigen::Vector4d& plane, const Eigen::Vector3f& p) {
  return plane.head<3>().dot(p.cast<double>()) + plane[3];
}

Indices sampleOf(const Cloud& cloud) {
  const Indices valid = validIndices(cloud);
  const std::size_t step = std::max<std::size_t>(1, valid.size() / SAMPLE_SIZE);
  Indices sample;
  for (std::size_t i = step / 2; i < valid.size(); i += step) sample.push_back(valid[i]);
  return sample;
}

/// The plane through most of the sample; its normal has any sign. With `up`, only planes within the
/// tilt limit are drawn.
std::optional<Eigen::Vector4d> ransacPlane(const Cloud& cloud, const Indices& sample,
                                           const std::optional<Eigen::Vector3d>& up,
                                           const TableOptions& options, std::mt19937& random) {
  if (sample.size() < 3) return std::nullopt;
  const double min_up = std::cos(options.max_tilt_deg * M_PI / 180);
  const auto draw = [&]() -> Eigen::Vector3d {
    return cloud.point(sample[random() % sample.size()]).cast<double>();
  };
  std::optional<Eigen::Vector4d> best;
  int most = 0;
  int needed = MAX_ITERATIONS;
  for (int iteration = 0; iteration < needed; ++iteration) {
    const Eigen::Vector3d a = draw(), b = draw(), c = draw();
    const Eigen::Vector3d cross = (b - a).cross(c - a);
    if (cross.norm() < 1e-9) continue;
    const Eigen::Vector3d normal = cross.normalized();
    if (up && std::abs(normal.dot(*up)) < min_up) continue;

    const Eigen::Vector4d plane(normal.x(), normal.y(), normal.z(), -normal.dot(a));
    const int inliers = static_cast<int>(std::count_if(sample.begin(), sample.end(), [&](int i) {
      return std::abs(distanceFrom(plane, cloud.point(i))) <= options.distance;
    }));
    if (inliers <= most) continue;
    most = inliers;
    best = plane;
    const double share = static_cast<double>(inliers) / sample.size();
    const double miss = 1 - share * share * share;
    if (miss < 1)
      needed =
          std::min(needed, static_cast<int>(std::ceil(std::log(1 - CONFIDENCE) / std::log(miss))));
  }
  return best;
}

/// Points no farther than `distance` from a plane.
Indices inliersOf(const Cloud& cloud, const Eigen::Vector4d& plane, double distance) {
  const Eigen::Vector4f q = plane.cast<float>();
  const auto limit = static_cast<float>(distance);
  Indices inliers(cloud.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const float d = q[0] * cloud.x[i] + q[1] * cloud.y[i] + q[2] * cloud.z[i] + q[3];
    inliers[count] = static_cast<int>(i);  // kept only if the next line counts it
    count += std::abs(d) <= limit;         // false for NaN
  }
  inliers.resize(count);
  return inliers;
}

struct LeastSquares {
  Eigen::Vector4d plane;
  double rms;
};

/// The plane of least squared distances of the points.
LeastSquares fitPlane(const Cloud& cloud, const Indices& indices) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const int i : indices) mean += cloud.point(i).cast<double>();
  mean /= static_cast<double>(indices.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const int i : indices) {
    const Eigen::Vector3d d = cloud.point(i).cast<double>() - mean;
    covariance += d * d.transpose();
  }
  covariance /= static_cast<double>(indices.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  const Eigen::Vector3d normal = solver.eigenvectors().col(0);
  return {{normal.x(), normal.y(), normal.z(), -normal.dot(mean)},
          std::sqrt(std::max(0.0, solver.eigenvalues()[0]))};
}

/// Two axes that span a plane, the first nearest to `forward`.
std::array<Eigen::Vector3d, 2> axesInPlane(const Eigen::Vector3d& normal,
                                           const Eigen::Vector3d& forward) {
  Eigen::Vector3d x = forward - normal * normal.dot(forward);
  if (x.norm() < 0.05) x = normal.unitOrthogonal();  // looked at from straight above
  x.normalize();
  return {x, normal.cross(x)};
}

/// Mean viewing ray of a cloud: forward, whatever the camera's convention.
Eigen::Vector3d forwardOf(const Cloud& cloud, const Indices& sample) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int i : sample) sum += cloud.point(i).cast<double>().normalized();
  return sum.norm() > 0 ? Eigen::Vector3d(sum.normalized()) : Eigen::Vector3d::UnitZ();
}

/// Points of a plane in the plane's own two coordinates.
std::vector<cv::Point2f> flatten(const Cloud& cloud, const Indices& indices,
                                 const Eigen::Vector3d& origin,
                                 const std::array<Eigen::Vector3d, 2>& axes) {
  std::vector<cv::Point2f> flat;
  flat.reserve(indices.size());
  for (const int i : indices) {
    const Eigen::Vector3d d = cloud.point(i).cast<double>() - origin;
    flat.emplace_back(static_cast<float>(axes[0].dot(d)), static_cast<float>(axes[1].dot(d)));
  }
  return flat;
}

/// Which of the points belong to the connected patches of the table. Objects and their shadows cut
/// one table into several; a plane also meets, by chance, a few points of other things.
std::vector<bool> tablePatches(const std::vector<cv::Point2f>& flat) {
  const cv::Rect2f extent = [&] {
    cv::Point2f low = flat.front(), high = low;
    for (const auto& p : flat) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    return cv::Rect2f(low, high);
  }();
  const float cell = std::max<float>(PATCH_CELL, std::max(extent.width, extent.height) / MAX_CELLS);
  const cv::Size size(static_cast<int>(extent.width / cell) + 1,
                      static_cast<int>(extent.height / cell) + 1);
  const auto cellOf = [&](const cv::Point2f& p) {
    return cv::Point(static_cast<int>((p.x - extent.x) / cell),
                     static_cast<int>((p.y - extent.y) / cell));
  };
  cv::Mat1b occupied = cv::Mat1b::zeros(size);
  for (const auto& p : flat) occupied(cellOf(p)) = 1;
  cv::dilate(occupied, occupied, cv::Mat1b::ones(PATCH_GAP + 1, PATCH_GAP + 1));

  cv::Mat1i patches;
  std::vector<int> counts(cv::connectedComponents(occupied, patches, 8, CV_32S));
  for (const auto& p : flat) ++counts[patches(cellOf(p))];
  const double least = MIN_PATCH_SHARE * *std::max_element(counts.begin(), counts.end());
  std::vector<bool> inside(flat.size());
  for (std::size_t i = 0; i < flat.size(); ++i)
    inside[i] = counts[patches(cellOf(flat[i]))] >= least;
  return inside;
}

Eigen::Vector2d centroidOfPolygon(const std::vector<Eigen::Vector2d>& polygon) {
  double area = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto& a = polygon[i];
    const auto& b = polygon[(i + 1) % polygon.size()];
    const double cross = a.x() * b.y() - b.x() * a.y();
    area += cross;
    sum += cross * (a + b);
  }
  return std::abs(area) > 1e-12 ? Eigen::Vector2d(sum / (3 * area)) : polygon.front();
}

/// Counter-clockwise convex hull; empty when the points lie on a line.
std::vector<Eigen::Vector2d> convexHull(const std::vector<cv::Point2f>& points) {
  std::vector<cv::Point2f> corners;
  cv::convexHull(points, corners);
  if (corners.size() < 3) return {};
  std::vector<Eigen::Vector2d> hull;
  for (const auto& corner : corners) hull.emplace_back(corner.x, corner.y);
  double area = 0;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const auto& a = hull[i];
    const auto& b = hull[(i + 1) % hull.size()];
    area += a.x() * b.y() - b.x() * a.y();
  }
  if (area < 0) std::reverse(hull.begin(), hull.end());
  return hull;
}

/// Signed distance of `p` from the hull's nearest edge line, positive inside; exact inside, and
/// never more negative than the true distance outside.
double depthInside(const std::vector<Eigen::Vector2d>& hull, const Eigen::Vector2d& p) {
  double least = std::numeric_limits<double>::max();
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Eigen::Vector2d& a = hull[i];
    const Eigen::Vector2d edge = (hull[(i + 1) % hull.size()] - a).normalized();
    const Eigen::Vector2d d = p - a;
    least = std::min(least, edge.x() * d.y() - edge.y() * d.x());
  }
  return least;
}

/// The table on a plane that RANSAC drew: refitted to all its points, their patches outlined.
Found<Table> tableOnPlane(const Cloud& cloud, const Eigen::Vector4d& drawn,
                          const Eigen::Vector3d& forward, const std::optional<Eigen::Vector3d>& up,
                          const TableOptions& options) {
  Indices inliers = inliersOf(cloud, drawn, options.distance);
  if (inliers.size() < 3) return Found<Table>::none("a plane of fewer than 3 points");
  LeastSquares fit = fitPlane(cloud, inliers);
  // Table and the foot of what stands on it share the band of `distance`; within three standard
  // deviations the table is nearly alone.
  const double band = std::clamp(3 * fit.rms, options.distance / 4, options.distance);
  for (int round = 0; round < 2; ++round) {
    inliers = inliersOf(cloud, fit.plane, band);
    if (inliers.size() < 3) return Found<Table>::none("a plane of fewer than 3 points");
    fit = fitPlane(cloud, inliers);
  }
  // The free side is where up points or, when up is not known, where the camera is.
  const double free_side = up ? fit.plane.head<3>().dot(*up) : fit.plane[3];
  if (free_side < 0) fit.plane = -fit.plane;

  const Eigen::Vector3d normal = fit.plane.head<3>();
  const Eigen::Vector3d foot = -fit.plane[3] * normal;
  const auto axes = axesInPlane(normal, forward);
  inliers = inliersOf(cloud, fit.plane, options.distance);
  const auto flat = flatten(cloud, inliers, foot, axes);
  const auto in_patch = tablePatches(flat);
  std::vector<cv::Point2f> patch;
  for (std::size_t i = 0; i < flat.size(); ++i)
    if (in_patch[i]) patch.push_back(flat[i]);
  auto hull = convexHull(patch);
  if (hull.empty()) return Found<Table>::none("a plane whose points lie on one line");

  Table table;
  for (std::size_t i = 0; i < flat.size(); ++i)
    if (in_patch[i] || depthInside(hull, {flat[i].x, flat[i].y}) >= 0)
      table.inliers.push_back(inliers[i]);
  const Eigen::Vector2d center = centroidOfPolygon(hull);
  for (auto& corner : hull) corner -= center;
  table.plane = fit.plane;
  table.rms = fit.rms;
  table.hull = std::move(hull);
  table.T_camera_table.linear() << axes[0], axes[1], normal;
  table.T_camera_table.translation() = foot + axes[0] * center.x() + axes[1] * center.y();
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

Cloud withoutPoints(Cloud cloud, const Indices& indices) {
  for (const int i : indices) cloud.drop(i);
  return cloud;
}

int carriedBy(const Cloud& cloud, const Table& table, const TableOptions& options) {
  const Cloud carried = pointsOnTable(cloud, table, options);
  return static_cast<int>(validIndices(carried).size());
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
  Indices sample = sampleOf(cloud);
  if (sample.empty()) return Found<Table>::none("the cloud has no valid point");
  const Eigen::Vector3d forward = forwardOf(cloud, sample);
  std::mt19937 random(static_cast<std::uint32_t>(options.seed));

  std::string first_refusal;
  std::optional<Table> bare;
  const Cloud* looked_at = &cloud;
  Cloud rest;  // what the planes before leave over: no point belongs to two
  for (int plane = 0; plane < options.max_planes; ++plane) {
    const auto drawn = ransacPlane(cloud, sample, plane == 0 ? std::nullopt : up, options, random);
    if (!drawn) break;
    auto table = tableOnPlane(*looked_at, *drawn, forward, up, options);
    const std::string why = table ? refusal(*table, up, options) : table.reason;
    if (why.empty()) {
      if (carriedBy(cloud, *table, options) >= options.min_carried) return table;
      if (!bare) bare = table.value;
    } else if (first_refusal.empty()) {
      first_refusal = why;
    }
    rest = withoutPoints(*looked_at, table ? table->inliers : Indices{});
    looked_at = &rest;
    const Eigen::Vector4d found = table ? table->plane : *drawn;
    sample.erase(std::remove_if(sample.begin(), sample.end(),
                                [&](int i) {
                                  return std::abs(distanceFrom(found, cloud.point(i))) <=
                                         1.5 * options.distance;
                                }),
                 sample.end());
  }
  if (bare) {
    Found<Table> found(*bare);
    found.reason = "nothing stands on it";
    return found;
  }
  return Found<Table>::none(first_refusal.empty() ? "no plane" : first_refusal);
}

Cloud pointsOnTable(const Cloud& cloud, const Table& table, const TableOptions& options) {
  const Eigen::Vector4f plane = table.plane.cast<float>();
  const Eigen::Isometry3d T_table_camera = table.T_camera_table.inverse();
  const auto overHull = [&](const Eigen::Vector3f& p) {
    const Eigen::Vector3d q = T_table_camera * p.cast<double>();
    return depthInside(table.hull, q.head<2>()) >= -options.hull_margin;
  };
  Cloud standing = cloud;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const float height =
        plane[0] * cloud.x[i] + plane[1] * cloud.y[i] + plane[2] * cloud.z[i] + plane[3];
    const bool stands =
        height >= options.min_height && height <= options.max_height && overHull(cloud.point(i));
    if (!stands) standing.drop(i);
  }
  return standing;
}

}  // namespace tabletop_perception
