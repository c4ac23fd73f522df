#include "tabletop_perception/propose.h"

#include <algorithm>
#include <set>
#include <utility>

#include "union_find.h"
#include "voxel_numbers.h"

namespace tabletop_perception {
namespace {

using Pairs = std::set<std::pair<int, int>>;  // first < second

Pairs touchingPairs(const Cloud& cloud, const std::vector<Indices>& clusters, double gap) {
  VoxelNumbers cubes;
  std::vector<std::vector<int>> clusters_in;  // each cube, ascending
  for (std::size_t k = 0; k < clusters.size(); ++k)
    for (const int i : clusters[k]) {
      const auto cube =
          static_cast<std::size_t>(cubes.numberOf(VoxelKey::of(cloud.point(i), 1.0 / gap)));
      if (cube == clusters_in.size()) clusters_in.emplace_back();
      auto& here = clusters_in[cube];
      if (here.empty() || here.back() != static_cast<int>(k)) here.push_back(static_cast<int>(k));
    }

  Pairs pairs;
  for (int cube = 0; cube < cubes.size(); ++cube)
    for (int n = 0; n < 14; ++n) {  // half of the cubes around it, and itself
      const VoxelKey& key = cubes.key(cube);
      const int near = cubes.find({key.x + n % 3 - 1, key.y + n / 3 % 3 - 1, key.z + n / 9 - 1});
      if (near < 0) continue;
      for (const int a : clusters_in[cube])
        for (const int b : clusters_in[near])
          if (a != b) pairs.insert(std::minmax(a, b));
    }
  return pairs;
}

}  // namespace

std::vector<std::vector<int>> clusterUnions(const Cloud& cloud,
                                            const std::vector<Indices>& clusters, double gap) {
  std::vector<std::vector<int>> unions;
  for (std::size_t k = 0; k < clusters.size(); ++k) unions.push_back({static_cast<int>(k)});
  if (!(gap > 0)) return unions;

  UnionFind groups(clusters.size());
  for (const auto& [a, b] : touchingPairs(cloud, clusters, gap)) {
    unions.push_back({a, b});
    groups.join(a, b);
  }
  std::vector<std::vector<int>> members(clusters.size());
  for (std::size_t k = 0; k < clusters.size(); ++k)
    members[groups.root(static_cast<int>(k))].push_back(static_cast<int>(k));
  for (auto& group : members)
    if (group.size() > 2) unions.push_back(std::move(group));
  return unions;
}

}  // namespace tabletop_perception
