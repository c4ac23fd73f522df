#include "tabletop_perception/cluster.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "simd.h"
#include "union_find.h"
#include "voxel_numbers.h"

namespace tabletop_perception {
namespace {

/// Points one after the other, from `begin` up to `end`.
struct Run {
  int begin, end;
};

float squaredDistance(const Cloud& points, int i, int j) {
  return (points.point(i) - points.point(j)).squaredNorm();
}

/// The squared gap that each point may leave: `tolerance`, or `noise_gap` times the squared range.
TABLETOP_SIMD_CLONES
void squaredGapsOf(const float* x, const float* y, const float* z, std::size_t count,
                   float tolerance, float noise_gap, float* gaps) {
  for (std::size_t i = 0; i < count; ++i) {
    const float by_noise = noise_gap * (x[i] * x[i] + (y[i] * y[i] + z[i] * z[i]));
    const float gap = by_noise > tolerance ? by_noise : tolerance;
    gaps[i] = gap * gap;
  }
}

/// Points of an organised cloud and how far apart they may be.
struct GappedPoints {
  const Cloud& points;
  std::vector<float> squared_gaps;

  GappedPoints(const Cloud& points, const ClusterOptions& options)
      : points(points), squared_gaps(points.size()) {
    squaredGapsOf(points.x.data(), points.y.data(), points.z.data(), points.size(),
                  static_cast<float>(options.tolerance), static_cast<float>(options.noise_gap),
                  squared_gaps.data());
  }

  bool near(int i, int j) const {
    return squaredDistance(points, i, j) <= std::max(squared_gaps[i], squared_gaps[j]);
  }

  double largestGap() const {
    using Gaps = Eigen::Map<const Eigen::ArrayXf>;
    return std::sqrt(
        Gaps(squared_gaps.data(), static_cast<Eigen::Index>(squared_gaps.size())).maxCoeff());
  }
};

/// Marks the points, but the first, that are near the one before.
TABLETOP_SIMD_CLONES
void markNear(const float* x, const float* y, const float* z, const float* squared_gaps,
              std::size_t count, std::uint8_t* marks) {
  for (std::size_t i = 1; i < count; ++i) {
    const float dx = x[i] - x[i - 1], dy = y[i] - y[i - 1], dz = z[i] - z[i - 1];
    const float squared = dx * dx + (dy * dy + dz * dz);
    marks[i] = (squared <= squared_gaps[i]) | (squared <= squared_gaps[i - 1]);
  }
}

/// The points at `pixels` of an organised cloud, cut where the row ends and where one is far from
/// the last before it. Pixels without a point lie between where the gap in space is small enough:
/// holes are bridged by metres.
std::vector<Run> runsAlongRows(const GappedPoints& gapped, const Indices& pixels, int width) {
  const Cloud& points = gapped.points;
  std::vector<std::uint8_t> near(points.size());
  markNear(points.x.data(), points.y.data(), points.z.data(), gapped.squared_gaps.data(),
           points.size(), near.data());
  std::vector<Run> runs;
  int row_end = 0;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    if (pixels[i] < row_end && near[i]) {
      runs.back().end = i + 1;
    } else {
      runs.push_back({i, i + 1});
      row_end = (pixels[i] / width + 1) * width;
    }
  }
  return runs;
}

std::vector<Run> singlePoints(std::size_t count) {
  std::vector<Run> runs;
  for (int i = 0; i < static_cast<int>(count); ++i) runs.push_back({i, i + 1});
  return runs;
}

/// Joins the runs of which a point is near the last one before it in its column.
UnionFind joinAlongColumns(const GappedPoints& points, const Indices& pixels, int width,
                           const std::vector<Run>& runs) {
  UnionFind sets(runs.size());
  struct Last {
    int point, run;
  };
  std::vector<Last> above(width, {-1, -1});  // in each column
  for (int r = 0; r < static_cast<int>(runs.size()); ++r) {
    const int row_begin = pixels[runs[r].begin] / width * width;
    int joined = -1;  // with this one before: no need to compare more of their points
    for (int i = runs[r].begin; i < runs[r].end; ++i) {
      Last& last = above[pixels[i] - row_begin];
      if (last.run >= 0 && last.run != joined && points.near(i, last.point)) {
        sets.join(r, last.run);
        joined = last.run;
      }
      last = {i, r};
    }
  }
  return sets;
}

/// The cube that a point lies in, 10 bits an axis. Cubes 1024 apart have the same key, which costs
/// comparisons of points that are not near, but no extent overflows.
using CubeKey = std::uint32_t;
constexpr CubeKey AXIS_MASK = 1023;

CubeKey cubeKey(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  return (x & AXIS_MASK) | (y & AXIS_MASK) << 10 | (z & AXIS_MASK) << 20;
}

struct CubeKeyHash {
  std::size_t operator()(CubeKey key) const { return key * 0x9E3779B97F4A7C15ull >> 32; }
};

TABLETOP_SIMD_CLONES
void cubeKeysOf(const float* x, const float* y, const float* z, std::size_t count,
                float cubes_per_metre, CubeKey* keys) {
  const auto along = [cubes_per_metre](float value) {
    const float place = std::clamp(value * cubes_per_metre, -1e9f, 1e9f);
    const int towards_zero = static_cast<int>(place);
    const bool below = place < static_cast<float>(towards_zero);
    return static_cast<std::uint32_t>(towards_zero - (below ? 1 : 0));
  };
  for (std::size_t i = 0; i < count; ++i) keys[i] = cubeKey(along(x[i]), along(y[i]), along(z[i]));
}

/// Points of one set in one cube: a chain of runs.
struct Part {
  int root;   ///< names the set
  int first;  ///< of its runs
  int next;   ///< part of the same cube; -1: none
};

/// Points by cubes a little larger than the tolerance, for the rounding, in each by sets: what is
/// near lies in neighbouring cubes.
struct PartsByCube {
  struct ChainedRun {
    Run run;
    int next;  ///< run of the same part; -1: none
  };
  Numbering<CubeKey, CubeKeyHash> cubes;
  std::vector<int> first_part;  ///< by cube
  std::vector<Part> parts;
  std::vector<ChainedRun> runs;

  PartsByCube(const Cloud& points, const std::vector<Run>& whole_runs, double tolerance,
              UnionFind& sets) {
    std::vector<CubeKey> keys(points.size());
    cubeKeysOf(points.x.data(), points.y.data(), points.z.data(), points.size(),
               static_cast<float>(0.999 / tolerance), keys.data());
    for (int r = 0; r < static_cast<int>(whole_runs.size()); ++r) {
      const int root = sets.root(r);
      for (int begin = whole_runs[r].begin; begin < whole_runs[r].end;) {
        int end = begin + 1;
        while (end < whole_runs[r].end && keys[end] == keys[begin]) ++end;
        add({begin, end}, keys[begin], root);
        begin = end;
      }
    }
  }

 private:
  void add(const Run& run, CubeKey key, int root) {
    const int cube = cubes.numberOf(key);
    if (cube == static_cast<int>(first_part.size())) first_part.push_back(-1);
    Part& part = parts[partOf(cube, root)];
    runs.push_back({run, part.first});
    part.first = static_cast<int>(runs.size()) - 1;
  }

  int partOf(int cube, int root) {
    for (int part = first_part[cube]; part >= 0; part = parts[part].next)
      if (parts[part].root == root) return part;
    parts.push_back({root, -1, first_part[cube]});
    return first_part[cube] = static_cast<int>(parts.size()) - 1;
  }
};

bool touch(const GappedPoints& points, const PartsByCube& grid, const Part& a, const Part& b) {
  for (int ra = a.first; ra >= 0; ra = grid.runs[ra].next)
    for (int rb = b.first; rb >= 0; rb = grid.runs[rb].next)
      for (int i = grid.runs[ra].run.begin; i < grid.runs[ra].run.end; ++i)
        for (int j = grid.runs[rb].run.begin; j < grid.runs[rb].run.end; ++j)
          if (points.near(i, j)) return true;
  return false;
}

/// Joins sets that are near in space though not along the grid's rows and columns: an object that
/// hides a strip of itself is seen in two pieces.
void joinAcrossSteps(const GappedPoints& points, const std::vector<Run>& runs, UnionFind& sets) {
  const PartsByCube grid(points.points, runs, points.largestGap(), sets);
  const auto joinParts = [&](int cube, int other) {
    for (int a = grid.first_part[cube]; a >= 0; a = grid.parts[a].next)
      for (int b = grid.first_part[other]; b >= 0; b = grid.parts[b].next) {
        const Part &one = grid.parts[a], &two = grid.parts[b];
        if (one.root != two.root && sets.root(one.root) != sets.root(two.root) &&
            touch(points, grid, one, two))
          sets.join(one.root, two.root);
      }
  };
  for (int cube = 0; cube < grid.cubes.size(); ++cube) {
    const CubeKey key = grid.cubes.key(cube);
    for (int n = 0; n < 14; ++n) {  // half of the cubes around it, and itself
      const int other = grid.cubes.find(
          cubeKey(key + n % 3 - 1, (key >> 10) + n / 3 % 3 - 1, (key >> 20) + n / 9 - 1));
      if (other >= 0) joinParts(cube, other);
    }
  }
}

/// Joins every point with all others within the tolerance, without a search for each: cubes are so
/// small that the points of one are all near each other, and two of them are compared until the
/// first pair that is near. (Fast Euclidean Clustering, Cao et al. 2022, searches about fewer
/// points too, but leaves some that are near apart.)
UnionFind joinAmongCubes(const Cloud& points, double tolerance) {
  const double side = 0.9999 * tolerance / std::sqrt(3.0);  // less than exact: for the rounding
  const auto squared_tolerance = static_cast<float>(tolerance * tolerance);
  UnionFind sets(points.size());
  VoxelNumbers cubes;
  std::vector<int> first_point;                    // by cube
  std::vector<int> next_point(points.size(), -1);  // of the same cube, by point; -1: none
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    const int cube = cubes.numberOf(VoxelKey::of(points.point(i), 1.0 / side));
    if (cube == static_cast<int>(first_point.size())) {
      first_point.push_back(i);
      continue;
    }
    const int first = first_point[cube];
    sets.join(first, i);
    next_point[i] = std::exchange(next_point[first], i);
  }

  const auto near = [&](int cube, int other) {
    for (int i = first_point[cube]; i >= 0; i = next_point[i])
      for (int j = first_point[other]; j >= 0; j = next_point[j])
        if ((points.point(i) - points.point(j)).squaredNorm() <= squared_tolerance) return true;
    return false;
  };
  for (int cube = 0; cube < cubes.size(); ++cube) {
    const VoxelKey key = cubes.key(cube);
    for (int n = 0; n < 62; ++n) {  // half of the cubes around it, two deep
      const int other = cubes.find({key.x + n % 5 - 2, key.y + n / 5 % 5 - 2, key.z + n / 25 - 2});
      if (other < 0) continue;
      const int i = first_point[cube], j = first_point[other];
      if (sets.root(i) != sets.root(j) && near(cube, other)) sets.join(i, j);
    }
  }
  return sets;
}

/// Runs of points, and which of them belong together.
struct ConnectedRuns {
  std::vector<Run> runs;
  UnionFind sets;
};

ConnectedRuns connectedRuns(const Cloud& points, const Indices& pixels, int width,
                            const ClusterOptions& options) {
  const GappedPoints gapped(points, options);
  auto runs = runsAlongRows(gapped, pixels, width);
  auto sets = joinAlongColumns(gapped, pixels, width, runs);
  joinAcrossSteps(gapped, runs, sets);
  return {std::move(runs), std::move(sets)};
}

ConnectedRuns connectedPoints(const Cloud& points, double tolerance) {
  return {singlePoints(points.size()), joinAmongCubes(points, tolerance)};
}

}  // namespace

std::vector<Indices> extractClusters(const Cloud& cloud, const ClusterOptions& options) {
  return extractClusters(cloud, validIndices(cloud), options);
}

std::vector<Indices> extractClusters(const Cloud& cloud, const Indices& among,
                                     const ClusterOptions& options) {
  checkOptions("cluster", options);
  const Cloud points = selectPositions(cloud, among);
  if (points.empty()) return {};
  auto [runs, sets] = cloud.organized() ? connectedRuns(points, among, cloud.width, options)
                                        : connectedPoints(points, options.tolerance);
  std::vector<int> sizes(runs.size(), 0);  // by root
  for (std::size_t r = 0; r < runs.size(); ++r)
    sizes[sets.root(static_cast<int>(r))] += runs[r].end - runs[r].begin;

  std::vector<Indices> clusters;
  std::vector<int> cluster_of(runs.size(), -1);  // by root
  for (std::size_t r = 0; r < runs.size(); ++r) {
    if (sizes[r] == 0 || sizes[r] < options.min_points || sizes[r] > options.max_points) continue;
    cluster_of[r] = static_cast<int>(clusters.size());
    clusters.emplace_back().reserve(sizes[r]);
  }
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const int cluster = cluster_of[sets.root(static_cast<int>(r))];
    if (cluster < 0) continue;
    clusters[cluster].insert(clusters[cluster].end(), among.begin() + runs[r].begin,
                             among.begin() + runs[r].end);
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
