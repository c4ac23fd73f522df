#include "tabletop_perception/cluster.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "tabletop_perception/kd_tree.h"
#include "union_find.h"
#include "voxel_numbers.h"

namespace tabletop_perception {
namespace {

/// Joins each of the points at `pixels` of an organised cloud with the last before it in its row
/// and in its column. Pixels without a point lie between where the gap in space is small enough:
/// holes are bridged by metres.
UnionFind joinOverGrid(const Cloud& points, const Indices& pixels, int width,
                       float squared_tolerance) {
  UnionFind sets(points.size());
  const auto joinIfNear = [&](int i, int j) {
    if (j >= 0 && (points.point(i) - points.point(j)).squaredNorm() <= squared_tolerance)
      sets.join(i, j);
  };
  std::vector<int> above(width, -1);  // the last point in each column
  int row_begin = -width;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    const bool same_row = pixels[i] < row_begin + width;
    if (same_row)
      joinIfNear(i, i - 1);
    else
      row_begin = pixels[i] / width * width;
    const int column = pixels[i] - row_begin;
    joinIfNear(i, above[column]);
    above[column] = i;
  }
  return sets;
}

/// Points of one set in one cube, chained.
struct Part {
  int root;   ///< names the set
  int first;  ///< its point
  int next;   ///< part of the same cube; -1: none
};

/// Points by cubes as large as the tolerance, in each by sets: what is near lies in neighbouring
/// cubes.
struct PartsByCube {
  VoxelNumbers cubes;
  std::vector<int> first_part;  ///< by cube
  std::vector<Part> parts;
  std::vector<int> next_point;  ///< of the same part, by point; -1: none

  PartsByCube(const Cloud& points, double tolerance, UnionFind& sets) : next_point(points.size()) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const int cube = cubes.numberOf(VoxelKey::of(points.point(i), 1.0 / tolerance));
      if (cube == static_cast<int>(first_part.size())) first_part.push_back(-1);
      Part& part = parts[partOf(cube, sets.root(static_cast<int>(i)))];
      next_point[i] = part.first;
      part.first = static_cast<int>(i);
    }
  }

 private:
  int partOf(int cube, int root) {
    for (int part = first_part[cube]; part >= 0; part = parts[part].next)
      if (parts[part].root == root) return part;
    parts.push_back({root, -1, first_part[cube]});
    return first_part[cube] = static_cast<int>(parts.size()) - 1;
  }
};

bool touch(const Cloud& points, const PartsByCube& grid, const Part& a, const Part& b,
           float squared_tolerance) {
  for (int i = a.first; i >= 0; i = grid.next_point[i])
    for (int j = b.first; j >= 0; j = grid.next_point[j])
      if ((points.point(i) - points.point(j)).squaredNorm() <= squared_tolerance) return true;
  return false;
}

/// Joins sets that are near in space though not along the grid's rows and columns: an object that
/// hides a strip of itself is seen in two pieces.
void joinAcrossSteps(const Cloud& points, double tolerance, UnionFind& sets) {
  const auto squared_tolerance = static_cast<float>(tolerance * tolerance);
  const PartsByCube grid(points, tolerance, sets);
  const auto joinParts = [&](int cube, int other) {
    for (int a = grid.first_part[cube]; a >= 0; a = grid.parts[a].next)
      for (int b = grid.first_part[other]; b >= 0; b = grid.parts[b].next) {
        const Part &one = grid.parts[a], &two = grid.parts[b];
        if (sets.root(one.root) != sets.root(two.root) &&
            touch(points, grid, one, two, squared_tolerance))
          sets.join(one.root, two.root);
      }
  };
  for (int cube = 0; cube < grid.cubes.size(); ++cube) {
    const VoxelKey key = grid.cubes.key(cube);
    for (int n = 0; n < 14; ++n) {  // half of the cubes around it, and itself
      const int other =
          grid.cubes.find({key.x + n % 3 - 1, key.y + n / 3 % 3 - 1, key.z + n / 9 - 1});
      if (other >= 0) joinParts(cube, other);
    }
  }
}

/// Joins every point with all others within the tolerance.
UnionFind joinThroughTree(const Cloud& points, double tolerance) {
  UnionFind sets(points.size());
  const KdTree tree(pointsAt(points, validIndices(points)));
  std::vector<KdTree::Neighbor> within;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    tree.within(points.point(i), tolerance, within);
    for (const auto& neighbor : within) sets.join(i, neighbor.index);
  }
  return sets;
}

}  // namespace

std::vector<Indices> extractClusters(const Cloud& cloud, const ClusterOptions& options) {
  return extractClusters(cloud, validIndices(cloud), options);
}

std::vector<Indices> extractClusters(const Cloud& cloud, const Indices& among,
                                     const ClusterOptions& options) {
  checkOptions("cluster", options);
  const Cloud points = selectPoints(cloud, among);
  const auto tolerance = static_cast<float>(options.tolerance);
  UnionFind sets = cloud.organized()
                       ? joinOverGrid(points, among, cloud.width, tolerance * tolerance)
                       : joinThroughTree(points, options.tolerance);
  if (cloud.organized()) joinAcrossSteps(points, options.tolerance, sets);
  std::vector<int> sizes(points.size(), 0);  // by root
  for (std::size_t i = 0; i < points.size(); ++i) ++sizes[sets.root(static_cast<int>(i))];

  std::vector<Indices> clusters;
  std::vector<int> cluster_of(points.size(), -1);  // by root
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (sizes[i] == 0 || sizes[i] < options.min_points || sizes[i] > options.max_points) continue;
    cluster_of[i] = static_cast<int>(clusters.size());
    clusters.emplace_back().reserve(sizes[i]);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    const int cluster = cluster_of[sets.root(static_cast<int>(i))];
    if (cluster >= 0) clusters[cluster].push_back(among[i]);
  }
  std::stable_sort(clusters.begin(), clusters.end(),
                   [](const Indices& a, const Indices& b) { return a.size() > b.size(); });
  return clusters;
}

std::vector<std::uint32_t> labelsOf(std::size_t cloud_size, const Indices& table,
                                    const std::vector<Indices>& clusters) {
  std::vector<std::uint32_t> labels(cloud_size, 0);
  for (const int i : table) labels[i] = 1;
  for (std::size_t k = 0; k < clusters.size(); ++k)
    for (const int i : clusters[k]) labels[i] = static_cast<std::uint32_t>(k) + 2;
  return labels;
}

std::vector<Indices> clustersOf(const std::vector<std::uint32_t>& labels) {
  std::vector<Indices> clusters;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    if (labels[i] < 2) continue;
    const std::size_t k = labels[i] - 2;
    if (k >= labels.size())
      throw std::invalid_argument("label " + std::to_string(labels[i]) + " at point " +
                                  std::to_string(i) + ": more clusters than points");
    if (k >= clusters.size()) clusters.resize(k + 1);
    clusters[k].push_back(static_cast<int>(i));
  }
  return clusters;
}

}  // namespace tabletop_perception
