#include "tabletop_perception/pick.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "format.h"
#include "main_plane.h"
#include "plane_fit.h"
#include "simd.h"
#include "tabletop_perception/geometry.h"

namespace tabletop_perception {
namespace {

constexpr double AT_EDGE = 0.01;  // of a cluster: its outermost points may lack [m]
constexpr int SCAN_STEP = 4;      // of the pixels that a window is looked for among
constexpr double SPREAD = 4, LEAST_SPREAD = 0.001;  // of a surface: medians of its noise [1, m]

/// Why a pixel cannot be looked at; empty if it can.
std::string pixelRefusal(const Eigen::Vector2d& pixel, int width, int height) {
  const bool inside = pixel.x() > -0.5 && pixel.y() > -0.5 && pixel.x() < width - 0.5 &&
                      pixel.y() < height - 0.5;  // not so for NaN
  return inside ? ""
                : format("pixel (%g, %g) is outside the image of %d x %d", pixel.x(), pixel.y(),
                         width, height);
}

std::string noDepth(const Eigen::Vector2d& pixel, int window) {
  return format("no depth within %d x %d pixels about (%g, %g)", window, window, pixel.x(),
                pixel.y());
}

TABLETOP_SIMD_CLONES
void squaredDistances(const float* x, const float* y, const float* z, std::size_t count,
                      const float* point, float* squared) {
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = x[i] - point[0], dy = y[i] - point[1], dz = z[i] - point[2];
    squared[i] = dx * dx + (dy * dy + dz * dz);
  }
}

/// Of each point from another one [m^2]; NaN where there is none.
std::vector<float> squaredDistances(const Cloud& cloud, const Eigen::Vector3f& point) {
  std::vector<float> squared(cloud.size());
  squaredDistances(cloud.x.data(), cloud.y.data(), cloud.z.data(), cloud.size(), point.data(),
                   squared.data());
  return squared;
}

/// The least of some values, of those that are not NaN; infinite without any.
TABLETOP_SIMD_CLONES
float leastOf(const float* values, std::size_t count) {
  constexpr std::size_t LANES = 8;
  float least[LANES];
  for (float& lane : least) lane = std::numeric_limits<float>::infinity();
  const std::size_t whole = count / LANES * LANES;
  for (std::size_t i = 0; i < whole; i += LANES)
    for (std::size_t l = 0; l < LANES; ++l)
      least[l] = values[i + l] < least[l] ? values[i + l] : least[l];
  for (std::size_t i = whole; i < count; ++i)
    least[0] = values[i] < least[0] ? values[i] : least[0];
  return *std::min_element(least, least + LANES);
}

/// Whether points of a cluster lie all around a point, as seen along a unit direction.
bool surrounds(const Cloud& cloud, const Indices& cluster, const Eigen::Vector3f& point,
               const Eigen::Vector3f& direction) {
  constexpr int SECTORS = 12;
  const Eigen::Vector3f u = direction.unitOrthogonal(), v = direction.cross(u);
  std::bitset<SECTORS> sectors;
  for (const int i : cluster) {
    const Eigen::Vector3f d = cloud.point(i) - point;
    const double turns = std::atan2(v.dot(d), u.dot(d)) / (2 * M_PI) + 0.5;
    sectors.set(std::min(SECTORS - 1, static_cast<int>(turns * SECTORS)));
  }
  return sectors.all();
}

/// Whether a point lies where things stand.
bool isAmongThings(const Eigen::Vector3f& point, const Table& table, const TableOptions& options) {
  const double height = heightAbove(table, point);
  return isOver(table, point, options.hull_margin) && height >= options.min_height &&
         height <= options.max_height;
}

/// Whether a cluster lies all around a point that belongs to none: as seen from above or, where
/// something is too small for a thing of its own, as the camera sees it.
bool isInside(const Cloud& cloud, const Indices& cluster, const Eigen::Vector3f& point,
              const Table& table, const TableOptions& options) {
  return surrounds(cloud, cluster, point, table.plane.head<3>().cast<float>()) ||
         (isAmongThings(point, table, options) &&
          surrounds(cloud, cluster, point, point.normalized()));
}

/// Why a point that belongs to no cluster is no thing's. `seen`: what the camera saw there.
std::string nothingAt(const Eigen::Vector3f& seen, const std::vector<Table>& tables,
                      const TableOptions& options) {
  const Table& table = tables[tableUnder(tables, seen)];
  const double height = heightAbove(table, seen);
  if (!isOver(table, seen, options.hull_margin))
    return format("on nothing that stands on a table: beside it, %.2f m %s", std::abs(height),
                  height < 0 ? "below its surface" : "above its surface");
  if (std::abs(height) < options.min_height)
    return format("on the table: %.3f m from its surface, things begin at %.3f m", std::abs(height),
                  options.min_height);
  if (height < 0) return format("on nothing that stands on a table: %.2f m below it", -height);
  if (height > options.max_height)
    return format("on nothing that stands on a table: %.2f m above it, limit %.2f", height,
                  options.max_height);
  return format("on something %.3f m above the table that is too small for a thing", height);
}

/// Turns an axis of a surface about: up where it rises, else away from the camera or to its left,
/// whichever is more.
Eigen::Vector3d directed(const Eigen::Vector3d& axis, const Table& table) {
  constexpr double RISING = 0.5;  // sine of the angle above the table
  const Eigen::Vector3d in_table = table.T_camera_table.linear().transpose() * axis;
  Eigen::Index most = 2;
  if (std::abs(in_table.z()) < RISING) in_table.head<2>().cwiseAbs().maxCoeff(&most);
  return in_table[most] < 0 ? Eigen::Vector3d(-axis) : axis;
}

/// How far from a plane its own points lie, of those within `distance`: a strip of a side face,
/// which comes as near, spreads evenly. A few times the median, as the strip leaves that be [m].
double spreadOf(const Cloud& points, const Eigen::Vector4d& plane, double distance) {
  std::vector<double> offsets;
  for (const int i : pointsNearPlane(points, plane, distance))
    offsets.push_back(std::abs(plane.head<3>().dot(points.point(i).cast<double>()) + plane[3]));
  const auto middle = offsets.begin() + static_cast<std::ptrdiff_t>(offsets.size() / 2);
  std::nth_element(offsets.begin(), middle, offsets.end());
  return std::clamp(SPREAD * *middle, std::min(LEAST_SPREAD, distance), distance);
}

/// The plane with its normal towards the sensor, the origin.
Eigen::Vector4d facingSensor(const Eigen::Vector4d& plane) {
  return plane[3] < 0 ? Eigen::Vector4d(-plane) : plane;
}

}  // namespace

Found<Eigen::Vector3f> pointAtPixel(const Cloud& cloud, const Eigen::Vector2d& pixel, int window) {
  using FoundPoint = Found<Eigen::Vector3f>;
  if (!cloud.organized())
    return FoundPoint::none("the cloud is unorganised: a pixel needs a camera's projection");
  const std::string refusal = pixelRefusal(pixel, cloud.width, cloud.height);
  if (!refusal.empty()) return FoundPoint::none(refusal);
  const int column = static_cast<int>(std::lround(pixel.x()));
  const int row = static_cast<int>(std::lround(pixel.y()));
  int nearest = -1, least = std::numeric_limits<int>::max();
  const int half = window / 2;
  for (int v = std::max(0, row - half); v <= std::min(cloud.height - 1, row + half); ++v)
    for (int u = std::max(0, column - half); u <= std::min(cloud.width - 1, column + half); ++u) {
      const int squared = (u - column) * (u - column) + (v - row) * (v - row);
      if (squared >= least || !cloud.valid(v * cloud.width + u)) continue;
      nearest = v * cloud.width + u;
      least = squared;
    }
  if (nearest < 0) return FoundPoint::none(noDepth(pixel, window));
  return cloud.point(nearest);
}

Found<Eigen::Vector3f> pointAtPixel(const Cloud& cloud, const Projection& projection,
                                    const Eigen::Vector2d& pixel, int window) {
  using FoundPoint = Found<Eigen::Vector3f>;
  const std::string refusal = pixelRefusal(pixel, projection.width, projection.height);
  if (!refusal.empty()) return FoundPoint::none(refusal);
  struct Hit {
    int point = -1;
    double squared_pixels = std::numeric_limits<double>::infinity(), depth = 0;
  } nearest;
  for (const int i : validIndices(cloud)) {
    const Eigen::Vector3d p = cloud.point(i).cast<double>();
    const double depth = projection.forward * p.z();
    if (!(depth > 0)) continue;
    const Eigen::Vector2d offset = projection.pixel(p) - pixel;
    if (offset.cwiseAbs().maxCoeff() > window / 2.0) continue;
    const double squared = std::max(0.25, offset.squaredNorm());  // within the pixel all are equal
    if (squared > nearest.squared_pixels ||
        (squared == nearest.squared_pixels && depth >= nearest.depth))
      continue;
    nearest = {i, squared, depth};
  }
  if (nearest.point < 0) return FoundPoint::none(noDepth(pixel, window));
  return cloud.point(nearest.point);
}

int CloudWindow::sourceOf(int i) const {
  if (!cloud.organized()) return source[i];
  return (row + step * (i / cloud.width)) * whole_width + column + step * (i % cloud.width);
}

namespace {

CloudWindow pointsAround(const Cloud& cloud, const Eigen::Vector3f& point, float squared_reach) {
  CloudWindow window;
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i)
    if ((cloud.point(i) - point).squaredNorm() <= squared_reach)  // not for NaN
      window.source.push_back(i);
  window.cloud = selectPoints(cloud, window.source);
  return window;
}

/// Squared distances from the sensor; infinite where there is no point.
TABLETOP_SIMD_CLONES
void squaredRanges(const float* x, const float* y, const float* z, std::size_t count,
                   float* squared) {
  for (std::size_t i = 0; i < count; ++i) {
    const float range = x[i] * x[i] + (y[i] * y[i] + z[i] * z[i]);
    squared[i] = range < std::numeric_limits<float>::infinity()
                     ? range
                     : std::numeric_limits<float>::infinity();
  }
}

TABLETOP_SIMD_CLONES
void takeLesser(const float* values, std::size_t count, float* least) {
  for (std::size_t i = 0; i < count; ++i) least[i] = values[i] < least[i] ? values[i] : least[i];
}

/// Marks the blocks of `step` values of which the least is far below the first of `firsts`.
TABLETOP_SIMD_CLONES
void markForeground(const float* least, const float* firsts, int blocks, int step,
                    std::uint8_t* marks) {
  constexpr float NEARER = 0.98f * 0.98f;  // of the range, squared
  for (int b = 0; b < blocks; ++b) marks[b] = 0;
  for (int k = 0; k < step; ++k)
    if (step == 2)  // a step that is known makes vector code
      for (int b = 0; b < blocks; ++b) marks[b] |= least[2 * b + k] < NEARER * firsts[2 * b];
    else
      for (int b = 0; b < blocks; ++b) marks[b] |= least[step * b + k] < NEARER * firsts[step * b];
}

/// Puts the nearest pixel of each block of step x step into its first one's place where a step in
/// depth runs through it: walls of a few pixels stay whole. `coarse`: the first ones.
void takeForeground(const Cloud& cloud, const PixelRectangle& part, int step, Cloud& coarse) {
  // Rows of a block one after the other, lengthened to whole blocks.
  const std::size_t width = static_cast<std::size_t>(coarse.width) * step;
  constexpr float NOWHERE = std::numeric_limits<float>::infinity();
  std::vector<float> ranges(width * step, NOWHERE), least(width, NOWHERE);
  std::vector<std::uint8_t> marks(coarse.width);
  for (int row = 0; row < coarse.height; ++row) {
    const int rows = std::min(step, part.height - row * step);
    const auto first = static_cast<std::size_t>(part.row + row * step) * cloud.width + part.column;
    for (int v = 0; v < rows; ++v) {
      const std::size_t i = first + static_cast<std::size_t>(v) * cloud.width;
      squaredRanges(&cloud.x[i], &cloud.y[i], &cloud.z[i], part.width, &ranges[v * width]);
    }
    std::copy_n(ranges.begin(), width, least.begin());
    for (int v = 1; v < rows; ++v) takeLesser(&ranges[v * width], width, least.data());
    markForeground(least.data(), ranges.data(), coarse.width, step, marks.data());
    for (int column = 0; column < coarse.width; ++column) {
      if (!marks[column]) continue;
      std::size_t nearest = 0;  // of the block
      float nearest_range = NOWHERE;
      for (int v = 0; v < rows; ++v)
        for (int u = column * step; u < (column + 1) * step; ++u) {
          const float range = ranges[v * width + u];
          if (range >= nearest_range) continue;
          nearest_range = range;
          nearest = first + static_cast<std::size_t>(v) * cloud.width + u;
        }
      const int cell = row * coarse.width + column;
      coarse.setPoint(cell, cloud.point(nearest));
      if (coarse.colored()) coarse.rgb[cell] = cloud.rgb[nearest];
    }
  }
}

CloudWindow windowOf(const Cloud& cloud, const PixelRectangle& part, int step) {
  CloudWindow window;
  window.cloud = decimated(cloud, part, step);
  if (step > 1) takeForeground(cloud, part, step, window.cloud);
  window.column = part.column;
  window.row = part.row;
  window.step = step;
  window.whole_width = cloud.width;
  return window;
}

}  // namespace

CloudWindow windowAround(const Cloud& cloud, const Eigen::Vector3f& point, double reach, int step) {
  const auto squared_reach = static_cast<float>(reach * reach);
  if (!cloud.organized()) return pointsAround(cloud, point, squared_reach);
  int left = cloud.width, right = -1, top = cloud.height, bottom = -1;
  for (int v = 0; v < cloud.height; v += SCAN_STEP)
    for (int u = 0; u < cloud.width; u += SCAN_STEP) {
      if (!((cloud.point(v * cloud.width + u) - point).squaredNorm() <= squared_reach)) continue;
      left = std::min(left, u), right = std::max(right, u);
      top = std::min(top, v), bottom = v;
    }
  if (right < left) return windowOf(cloud, {}, step);
  left = std::max(0, left - SCAN_STEP);
  top = std::max(0, top - SCAN_STEP);
  return windowOf(cloud,
                  {left, top, std::min(cloud.width, right + SCAN_STEP + 1) - left,
                   std::min(cloud.height, bottom + SCAN_STEP + 1) - top},
                  step);
}

CloudWindow withEveryPixel(const Cloud& cloud, const CloudWindow& window) {
  return windowOf(cloud,
                  {window.column, window.row,
                   std::min(cloud.width - window.column, window.step * window.cloud.width),
                   std::min(cloud.height - window.row, window.step * window.cloud.height)},
                  1);
}

Found<int> clusterAt(const Cloud& cloud, const std::vector<Indices>& clusters,
                     const Eigen::Vector3f& point, const std::vector<Table>& tables,
                     const TableOptions& table_options, const PickOptions& options) {
  const auto squared = squaredDistances(cloud, point);
  const float least = leastOf(squared.data(), squared.size());
  const double seen = std::sqrt(least);  // how far off the nearest that the camera saw is
  if (!(seen <= options.max_distance))
    return Found<int>::none(
        std::isinf(least)
            ? format("in the air: the camera saw nothing within %.2f m of the point", options.reach)
            : format("in the air: the nearest that the camera saw is %.3f m away, limit %.3f", seen,
                     options.max_distance));
  int nearest = -1;
  float least_of_things = std::numeric_limits<float>::infinity();
  for (std::size_t k = 0; k < clusters.size(); ++k)
    for (const int i : clusters[k]) {
      if (squared[i] >= least_of_things) continue;
      least_of_things = squared[i];
      nearest = static_cast<int>(k);
    }
  if (nearest >= 0 && std::sqrt(least_of_things) <= seen + AT_EDGE) return nearest;
  const Eigen::Vector3f there =
      cloud.point(std::find(squared.begin(), squared.end(), least) - squared.begin());
  const std::string nothing = nothingAt(there, tables, table_options);
  if (nearest < 0 ||
      !isInside(cloud, clusters[nearest], there, tables[tableUnder(tables, there)], table_options))
    return Found<int>::none(nothing);
  Found<int> around(nearest);
  around.reason = nothing;
  return around;
}

Found<GraspSurface> graspSurface(const Cloud& cloud, const Indices& thing, const Table& table,
                                 const PickOptions& options) {
  checkOptions("pick", options);
  const Cloud points = selectPoints(cloud, thing);
  const auto largest = mainPlane(points, options.surface_distance);
  if (!largest)
    return Found<GraspSurface>::none(format("its %zu points span no surface", thing.size()));
  const Cloud near = selectPoints(
      points,
      pointsNearPlane(points, *largest, spreadOf(points, *largest, options.surface_distance)));
  const Eigen::Vector3d middle = centroidOf(pointsAt(near, validIndices(near))).cast<double>();

  GraspSurface surface;
  surface.plane = facingSensor(*largest);
  surface.points = static_cast<int>(near.size());
  const Eigen::Vector3d z = surface.plane.head<3>();

  const Box sides = boxAround(pointsAt(near, validIndices(near)), z);
  Eigen::Index thickness;
  (sides.T_camera_box.linear().transpose() * z).cwiseAbs().maxCoeff(&thickness);
  const Eigen::Index longer = thickness == 0 ? 1 : 0, shorter = thickness == 2 ? 1 : 2;
  const Eigen::Vector3d x = directed(sides.T_camera_box.linear().col(longer), table);

  surface.extents = {sides.size[longer], sides.size[shorter]};
  const double height = heightAbove(table, middle.cast<float>());
  const double sinking = z.dot(table.plane.head<3>());  // per metre of depth
  const double depth =
      sinking > 0 ? std::min(options.depth, std::max(0.0, height) / 2 / sinking) : options.depth;
  surface.T_camera_pick.linear() << x, z.cross(x), z;
  surface.T_camera_pick.translation() = middle - depth * z;
  return surface;
}

}  // namespace tabletop_perception
