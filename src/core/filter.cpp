#include "tabletop_perception/filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "range_crop.h"
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

/// Cubes of consecutive points, and where in them the points lie [m].
struct VoxelBlock {
  static constexpr std::size_t SIZE = 512;
  std::array<std::int32_t, SIZE> column, row, layer;
  std::array<float, SIZE> x, y, z;
};

/// The cube of each of at most VoxelBlock::SIZE coordinates, any one for NaN. Single precision
/// moves the sides of a cube by less than a millionth of where it lies.
TABLETOP_SIMD_CLONES
void placeAlong(const float* from, std::size_t count, float leaf, std::int32_t* cube,
                float* within) {
  constexpr float LAST = 1 << 30;  // beyond, the last cube holds all: no extent overflows
  const float per_metre = 1 / leaf;
  for (std::size_t i = 0; i < count; ++i) {
    const float raw = from[i] * per_metre;
    const float raised = raw > -LAST ? raw : -LAST;  // NaN too
    const float place = raised < LAST ? raised : LAST;
    const auto towards_zero = static_cast<std::int32_t>(place);
    cube[i] = towards_zero - (place < static_cast<float>(towards_zero) ? 1 : 0);
    within[i] = from[i] - static_cast<float>(cube[i]) * leaf;
  }
}

/// Sums over the points of one voxel; places from its corner [m].
struct VoxelSum {
  VoxelKey voxel;
  float x = 0, y = 0, z = 0;
  std::uint32_t red = 0, green = 0, blue = 0, count = 0;

  Eigen::Vector3f mean(double leaf) const {
    const Eigen::Vector3d corner = leaf * Eigen::Vector3d(voxel.x, voxel.y, voxel.z);
    return (corner + Eigen::Vector3d(x, y, z) / count).cast<float>();
  }
  std::uint32_t meanColor() const {
    const auto mean = [this](std::uint32_t sum) { return (sum + count / 2) / count; };
    return mean(red) << 16 | mean(green) << 8 | mean(blue);
  }
};

/// The occupied voxels in the order of their first points. Bricks of 4 x 4 x 4 voxels are looked
/// up, voxels in them are addressed: points come in runs that stay in one brick.
class Voxels {
 public:
  VoxelSum& at(const VoxelKey& voxel) {
    const int brick = bricks_.numberOf({voxel.x >> 2, voxel.y >> 2, voxel.z >> 2});
    const std::size_t first = static_cast<std::size_t>(brick) * BRICK;
    if (first == number_of_.size()) number_of_.resize(first + BRICK, -1);
    int& number = number_of_[first + ((voxel.x & 3) | (voxel.y & 3) << 2 | (voxel.z & 3) << 4)];
    if (number < 0) {
      number = static_cast<int>(sums_.size());
      sums_.push_back({voxel});
    }
    return sums_[number];
  }

  const std::vector<VoxelSum>& sums() const { return sums_; }

 private:
  static constexpr std::size_t BRICK = 64;  // voxels

  VoxelNumbers bricks_;
  std::vector<int> number_of_;  // of each voxel of each brick, -1 for none yet
  std::vector<VoxelSum> sums_;
};

Eigen::Isometry3d boxPose(const FilterOptions& options) {
  return Eigen::Translation3d(options.box_x, options.box_y, options.box_z) *
         Eigen::AngleAxisd(options.box_yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(options.box_pitch, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(options.box_roll, Eigen::Vector3d::UnitX());
}

/// What follows the crop by range.
Cloud filterInRange(Cloud filtered, const FilterOptions& options) {
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

}  // namespace

Cloud cropRange(Cloud cloud, double min, double max) {
  dropOutside(cloud.x.data(), cloud.y.data(), cloud.z.data(), cloud.size(), min, max);
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
  const auto side = static_cast<float>(leaf);
  Voxels voxels;
  VoxelBlock block;
  for (std::size_t begin = 0; begin < cloud.size(); begin += VoxelBlock::SIZE) {
    const std::size_t count = std::min(VoxelBlock::SIZE, cloud.size() - begin);
    placeAlong(&cloud.x[begin], count, side, block.column.data(), block.x.data());
    placeAlong(&cloud.y[begin], count, side, block.row.data(), block.y.data());
    placeAlong(&cloud.z[begin], count, side, block.layer.data(), block.z.data());
    for (std::size_t i = 0; i < count; ++i) {
      if (!cloud.valid(begin + i)) continue;
      VoxelSum& sum = voxels.at({block.column[i], block.row[i], block.layer[i]});
      sum.x += block.x[i];
      sum.y += block.y[i];
      sum.z += block.z[i];
      ++sum.count;
      if (!cloud.colored()) continue;
      const std::uint32_t rgb = cloud.rgb[begin + i];
      sum.red += rgb >> 16 & 0xFF;
      sum.green += rgb >> 8 & 0xFF;
      sum.blue += rgb & 0xFF;
    }
  }

  const auto& sums = voxels.sums();
  Cloud grid(static_cast<int>(sums.size()), 1, cloud.colored());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    grid.setPoint(i, sums[i].mean(side));
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
  return filterInRange(cropRange(std::move(cloud), options.min_range, options.max_range), options);
}

Cloud filterCloud(const PackedCloud& packed, const FilterOptions& options) {
  checkOptions("filter", options);
  return filterInRange(unpackCloud(packed, options.min_range, options.max_range), options);
}

}  // namespace tabletop_perception
