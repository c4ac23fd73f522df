#pragma once

#include <map>
#include <utility>
#include <vector>

namespace tabletop_perception {

/// Regions of a surface and the borders between them, joined step by step.
class RegionGraph {
 public:
  /// `sizes`: points of each region.
  explicit RegionGraph(std::vector<int> sizes);

  /// Adds a piece of border between two regions; `vote` from -1 (they are two things) to 1 (one).
  void addBorder(int a, int b, double vote);

  /// Joins the two regions with the highest sum of votes along their border until no sum is
  /// positive. Joining adds the borders up, so a short convex edge does not outweigh a long hollow.
  void joinByVotes();

  /// Joins every region of fewer points than `min_size` with the neighbour that shares its longest
  /// border, smallest first; regions without a neighbour stay.
  void absorbSmall(int min_size);

  /// The region that a region has become part of.
  int find(int region) const;

 private:
  struct Border {
    int length = 0;
    double votes = 0;
  };
  using Pair = std::pair<int, int>;

  void join(int into, int from);

  std::vector<int> sizes_;
  std::vector<int> parent_;
  std::map<Pair, Border> borders_;  // first < second, both roots
};

}  // namespace tabletop_perception
