#include "tabletop_perception/cluster.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include "tabletop_perception/kd_tree.h"
#include "union_find.h"
#include "voxel_key.h"

namespace tabletop_perception {
namespace {

/// Joins each pixel with the last point before it in its row and in its column. Pixels without a
/// point lie between where the gap in space is small enough: holes are bridged by metres.
UnionFind joinOverGrid(const Cloud& cloud, float squared_tolerance) {
  UnionFind sets(cloud.size());
  const auto joinIfNear = [&](int i, int j) {
    if (j >= 0 && (cloud.point(i) - cloud.point(j)).squaredNorm() <= squared_tolerance)
      sets.join(i, j);
  };
  std::vector<int> above(cloud.width, -1);  // the last point in each column
  for (int row = 0; row < cloud.height; ++row) {
    int left = -1;
    for (int column = 0; column < cloud.width; ++column) {
      const int i = row * cloud.width + column;
      if (!cloud.valid(i)) continue;
      joinIfNear(i, left);
      joinIfNear(i, above[column]);
      left = above[column] = i;
    }
  }
  return sets;
}

/// Points of one set in one cube.
struct Part {
  int root;  ///< names the set
  Indices points;
};
using Cubes = std::unordered_map<VoxelKey, std::vector<Part>, VoxelKeyHash>;

/// The points by cubes as large as the tolerance: what is near lies in neighbouring cubes.
Cubes partsByCube(const Cloud& cloud, double tolerance, UnionFind& sets) {
  Cubes cubes;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!cloud.valid(i)) continue;
    const int root = sets.root(static_cast<int>(i));
    auto& parts = cubes[VoxelKey::of(cloud.point(i), 1.0 / tolerance)];
    auto part = std::find_if(parts.begin(), parts.end(),
                             [=](const Part& other) { return other.root == root; });
    if (part == parts.end()) part = parts.insert(part, {root, {}});
    part->points.push_back(static_cast<int>(i));
  }
  return cubes;
}

bool touch(const Cloud& cloud, const Part& a, const Part& b, float squared_tolerance) {
  for (const int i : a.points)
    for (const int j : b.points)
      if ((cloud.point(i) - cloud.point(j)).squaredNorm() <= squared_tolerance) return true;
  return false;
}

/// Joins sets that are near in space though not along the grid's rows and columns: an object that
/// hides a strip of itself is seen in two pieces.
void joinAcrossSteps(const Cloud& cloud, double tolerance, UnionFind& sets) {
  const auto squared_tolerance = static_cast<float>(tolerance * tolerance);
  const Cubes cubes = partsByCube(cloud, tolerance, sets);
  for (const auto& [key, parts] : cubes)
    for (int n = 0; n < 14; ++n) {  // half of the cubes around it, and itself
      const auto near = cubes.find({key.x + n % 3 - 1, key.y + n / 3 % 3 - 1, key.z + n / 9 - 1});
      if (near == cubes.end()) continue;
      for (const Part& a : parts)
        for (const Part& b : near->second)
          if (sets.root(a.root) != sets.root(b.root) && touch(cloud, a, b, squared_tolerance))
            sets.join(a.root, b.root);
    }
}

/// Joins every point with all others within the tolerance.
UnionFind joinThroughTree(const Cloud& cloud, double tolerance) {
  UnionFind sets(cloud.size());
  const Indices valid = validIndices(cloud);
  const KdTree tree(pointsAt(cloud, valid));
  std::vector<KdTree::Neighbor> within;
  for (const int i : valid) {
    tree.within(cloud.point(i), tolerance, within);
    for (const auto& neighbor : within) sets.join(i, valid[neighbor.index]);
  }
  return sets;
}

}  // namespace

std::vector<Indices> extractClusters(const Cloud& cloud, const ClusterOptions& options) {
  checkOptions("cluster", options);
  const auto tolerance = static_cast<float>(options.tolerance);
  UnionFind sets = cloud.organized() ? joinOverGrid(cloud, tolerance * tolerance)
                                     : joinThroughTree(cloud, options.tolerance);
  if (cloud.organized()) joinAcrossSteps(cloud, options.tolerance, sets);
  std::vector<int> sizes(cloud.size(), 0);  // by root
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (cloud.valid(i)) ++sizes[sets.root(static_cast<int>(i))];

  std::vector<Indices> clusters;
  std::vector<int> cluster_of(cloud.size(), -1);  // by root
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (sizes[i] == 0 || sizes[i] < options.min_points || sizes[i] > options.max_points) continue;
    cluster_of[i] = static_cast<int>(clusters.size());
    clusters.emplace_back().reserve(sizes[i]);
  }
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!cloud.valid(i)) continue;
    const int cluster = cluster_of[sets.root(static_cast<int>(i))];
    if (cluster >= 0) clusters[cluster].push_back(static_cast<int>(i));
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
