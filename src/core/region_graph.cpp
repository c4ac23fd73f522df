#include "region_graph.h"

#include <algorithm>
#include <numeric>

namespace tabletop_perception {

RegionGraph::RegionGraph(std::vector<int> sizes)
    : sizes_(std::move(sizes)), parent_(sizes_.size()) {
  std::iota(parent_.begin(), parent_.end(), 0);
}

void RegionGraph::addBorder(int a, int b, double vote) {
  Border& border = borders_[std::minmax(a, b)];
  ++border.length;
  border.votes += vote;
}

int RegionGraph::find(int region) const {
  while (parent_[region] != region) region = parent_[region];
  return region;
}

void RegionGraph::join(int into, int from) {
  parent_[from] = into;
  sizes_[into] += sizes_[from];
  std::vector<std::pair<int, Border>> moved;  // neighbours of `from`
  for (auto it = borders_.begin(); it != borders_.end();) {
    const auto [a, b] = it->first;
    if (a != from && b != from) {
      ++it;
      continue;
    }
    const int other = a == from ? b : a;
    if (other != into) moved.emplace_back(other, it->second);
    it = borders_.erase(it);
  }
  for (const auto& [other, border] : moved) {
    Border& sum = borders_[std::minmax(into, other)];
    sum.length += border.length;
    sum.votes += border.votes;
  }
}

void RegionGraph::joinByVotes() {
  while (true) {
    const auto best = std::max_element(
        borders_.begin(), borders_.end(),
        [](const auto& a, const auto& b) { return a.second.votes < b.second.votes; });
    if (best == borders_.end() || best->second.votes <= 0) return;
    const auto [into, from] = best->first;
    join(into, from);
  }
}

void RegionGraph::absorbSmall(int min_size) {
  while (true) {
    // The smallest region with a border, and among its borders the longest.
    int small = -1, neighbor = -1, longest = 0;
    for (const auto& [pair, border] : borders_)
      for (const auto& [region, other] : {pair, Pair(pair.second, pair.first)}) {
        if (sizes_[region] >= min_size) continue;
        const bool smaller = small < 0 || sizes_[region] < sizes_[small];
        if (!smaller && !(region == small && border.length > longest)) continue;
        small = region;
        neighbor = other;
        longest = border.length;
      }
    if (small < 0) return;
    join(neighbor, small);
  }
}

}  // namespace tabletop_perception
