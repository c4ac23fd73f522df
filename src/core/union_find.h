#pragma once

#include <cstddef>
#include <numeric>
#include <vector>

namespace tabletop_perception {

/// Disjoint sets of numbers from 0 up, each named by its lowest.
class UnionFind {
 public:
  explicit UnionFind(std::size_t size) : parent_(size) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int root(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

  void join(int a, int b) {
    if (parent_[a] == parent_[b]) return;
    a = root(a);
    b = root(b);
    if (a < b) parent_[b] = a;
    if (b < a) parent_[a] = b;
  }

 private:
  std::vector<int> parent_;
};

}  // namespace tabletop_perception
