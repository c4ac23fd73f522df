#include "tabletop_perception/filter.h"

#include <cmath>
#include <utility>
#include <vector>

#include "simd.h"
#include "tabletop_perception/kd_tree.h"
#include "voxel_numbers.h"

namespace tabletop_perception {
namespace {

/// The cloud without the points for which `keep` is false.
template <typename Predicate>
Cloud keepIf(Cloud cloud, Predicate keep) {
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (cloud.valid(i) && !keep(cloud.point(i))) cloud.drop(i);
  return cloud;
}

/// Drops points unless their squared distance from the sensor is within the limits.
TABLETOP_SIMD_CLONES
void dropOutside(float* x, float* y, float* z, std::size_t count, float nearest, float farthest) {
  for (std::size_t i = 0; i < count; ++i) {
    const float squared_range = x[i] * x[i] + (y[i] * y[i] + z[i] * z[i]);
    const bool within = (squared_range >= nearest) & (squared_range <= farthest);
    x[i] = nanUnless(within, x[i]);
    y[i] = nanUnless(within, y[i]);
    z[i] = nanUnless(within, z[i]);
  }
}

/// Sums of the points of one voxel.
struct VoxelSum {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  double red = 0, green = 0, blue = 0;
  int count = 0;

  std::uint32_t meanColor() const {
    const auto mean = [this](double sum) {
      return static_cast<std::uint32_t>(std::lround(sum / count));
    };
    return mean(red) << 16 | mean(green) << 8 | mean(blue);
  }
};

Eigen::Isometry3d boxPose(const FilterOptions& options) {
  return Eigen::Translation3d(options.box_x, options.box_y, options.box_z) *
         Eigen::AngleAxisd(options.box_yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(options.box_pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(options.box_roll, Eigen::Vector3d::UnitX());
}

}  // namespace

Cloud cropRange(Cloud cloud, double min, double max) {
  dropOutside(cloud.x.data(), cloud.y.data(), cloud.z.data(), cloud.size(),
              static_cast<float>(min * min), static_cast<float>(max * max));
  return cloud;
}

Cloud cropAxis(Cloud cloud, int axis, double min, double max) {
  return keepIf(std::move(cloud),
                [=](const Eigen::Vector3f& p) { return p[axis] >= min && p[axis] <= max; });
}

Cloud cropBox(Cloud cloud, const Eigen::Isometry3d& T_camera_box, const Eigen::Vector3d& size) {
  const Eigen::Isometry3f T_box_camera = T_camera_box.inverse().cast<float>();
  const Eigen::Array3f half = size.cast<float>() / 2;
  return keepIf(std::move(cloud), [&](const Eigen::Vector3f& p) {
    return ((T_box_camera * p).array().abs() <= half).all();
  });
}

Cloud voxelGrid(const Cloud& cloud, double leaf) {
  checkOption("leaf", leaf, Range{1e-6, 1e3});
  VoxelNumbers voxels;
  std::vector<VoxelSum> sums;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!cloud.valid(i)) continue;
    const Eigen::Vector3f p = cloud.point(i);
    const int number = voxels.numberOf(VoxelKey::of(p, 1.0 / leaf));
    if (number == static_cast<int>(sums.size())) sums.emplace_back();
    VoxelSum& sum = sums[number];
    sum.point += p.cast<double>();
    ++sum.count;
    if (!cloud.colored()) continue;
    sum.red += cloud.rgb[i] >> 16 & 0xFF;
    sum.green += cloud.rgb[i] >> 8 & 0xFF;
    sum.blue += cloud.rgb[i] & 0xFF;
  }

  Cloud grid(static_cast<int>(sums.size()), 1, cloud.colored());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    grid.setPoint(i, (sums[i].point / sums[i].count).cast<float>());
    if (grid.colored()) grid.rgb[i] = sums[i].meanColor();
  }
  return grid;
}

Cloud removeStatisticalOutliers(const Cloud& cloud, int neighbors, double deviations) {
  const Indices valid = validIndices(cloud);
  if (valid.empty()) return cloud;
  const KdTree tree(pointsAt(cloud, valid));
  std::vector<double> distances(valid.size());
  std::vector<KdTree::Neighbor> nearest;
  double sum = 0, sum_of_squares = 0;
  for (std::size_t i = 0; i < valid.size(); ++i) {
    tree.nearest(cloud.point(valid[i]), neighbors + 1, nearest);  // the first is the point itself
    double total = 0;
    for (const auto& neighbor : nearest) total += std::sqrt(neighbor.squared_distance);
    distances[i] = total / std::max<std::size_t>(1, nearest.size() - 1);
    sum += distances[i];
    sum_of_squares += distances[i] * distances[i];
  }
  const double mean = sum / valid.size();
  const double variance = std::max(0.0, sum_of_squares / valid.size() - mean * mean);
  const double limit = mean + deviations * std::sqrt(variance);

  Cloud kept = cloud;
  for (std::size_t i = 0; i < valid.size(); ++i)
    if (distances[i] > limit) kept.drop(valid[i]);
  return kept;
}

Cloud removeRadiusOutliers(const Cloud& cloud, int neighbors, double radius) {
  const Indices valid = validIndices(cloud);
  if (valid.empty()) return cloud;
  const KdTree tree(pointsAt(cloud, valid));
  Cloud kept = cloud;
  std::vector<KdTree::Neighbor> within;
  for (const int i : valid) {
    tree.within(cloud.point(i), radius, within);
    const int others = static_cast<int>(within.size()) - 1;
    if (others < neighbors) kept.drop(i);
  }
  return kept;
}

Cloud filterCloud(Cloud cloud, const FilterOptions& options) {
  checkOptions("filter", options);
  if (!(options.min_range < options.max_range))
    throw std::invalid_argument("filter.min_range must be below filter.max_range, got " +
                                std::to_string(options.min_range) + " and " +
                                std::to_string(options.max_range));
  if (!(options.crop_min < options.crop_max))
    throw std::invalid_argument("filter.crop_min must be below filter.crop_max, got " +
                                std::to_string(options.crop_min) + " and " +
                                std::to_string(options.crop_max));

  Cloud filtered = cropRange(std::move(cloud), options.min_range, options.max_range);
  if (options.crop_axis != "none")
    filtered = cropAxis(std::move(filtered), options.crop_axis[0] - 'x', options.crop_min,
                        options.crop_max);
  if (options.box)
    filtered = cropBox(std::move(filtered), boxPose(options),
                       {options.box_size_x, options.box_size_y, options.box_size_z});
  if (options.leaf_size > 0) filtered = voxelGrid(filtered, options.leaf_size);
  if (options.outliers == "statistical")
    filtered =
        removeStatisticalOutliers(filtered, options.outlier_neighbors, options.outlier_deviations);
  if (options.outliers == "radius")
    filtered = removeRadiusOutliers(filtered, options.outlier_neighbors, options.outlier_radius);
  return filtered;
}

}  // namespace tabletop_perception
