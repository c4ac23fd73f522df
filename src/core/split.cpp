#include "tabletop_perception/split.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "region_graph.h"
#include "tabletop_perception/normals.h"
#include "union_find.h"

namespace tabletop_perception {
namespace {

/// The step [pixels] between pixels that are `spacing_deg` apart, by the median angle between
/// neighbouring pixels of the clusters.
int stepOf(const Cloud& cloud, const std::vector<Indices>& clusters, double spacing_deg) {
  constexpr std::size_t STRIDE = 20;  // every so manieth point is asked
  constexpr long MAX_STEP = 8;
  std::vector<float> sines;
  for (const auto& cluster : clusters)
    for (std::size_t k = 1; k < cluster.size(); k += STRIDE) {
      const int i = cluster[k];
      if (cluster[k - 1] != i - 1 || i % cloud.width == 0) continue;
      sines.push_back(cloud.point(i).normalized().cross(cloud.point(i - 1).normalized()).norm());
    }
  if (sines.empty()) return 1;
  const auto median = sines.begin() + static_cast<std::ptrdiff_t>(sines.size() / 2);
  std::nth_element(sines.begin(), median, sines.end());
  const double pixels = spacing_deg * M_PI / 180 / std::max(*median, 1e-6f);
  return static_cast<int>(std::clamp(std::lround(pixels), 1L, MAX_STEP));
}

/// Every step-th pixel of the part of the image that the clusters lie in.
struct Grid {
  int step = 1;
  int image_width = 0;       ///< [pixels]
  int column = 0, row = 0;   ///< of the image, where the first cell begins
  Cloud cloud;               ///< cells without a point of a cluster are empty
  std::vector<int> cluster;  ///< of each cell, -1 without

  int cells() const { return static_cast<int>(cloud.size()); }
  /// Where the cell of a pixel lies.
  std::pair<int, int> placeOf(int pixel) const {
    const int image_row = pixel / image_width;
    return {(pixel - image_row * image_width - column) / step, (image_row - row) / step};
  }
  bool near(int a, int b, float squared_gap) const {
    return cluster[a] == cluster[b] &&
           (cloud.point(a) - cloud.point(b)).squaredNorm() <= squared_gap;
  }
};

/// Calls visit(cell, neighbour) for each pair of cells side by side, in the order of the grid.
template <typename Visit>
void visitNeighbors(const Grid& grid, Visit visit) {
  const int width = grid.cloud.width;
  for (int i = 0; i < grid.cells(); ++i) {
    if (grid.cluster[i] < 0) continue;
    if (i % width > 0 && grid.cluster[i - 1] >= 0) visit(i, i - 1);
    if (i >= width && grid.cluster[i - width] >= 0) visit(i, i - width);
  }
}

/// The first pixel of each step x step block that belongs to a cluster stands for the block.
Grid gridOf(const Cloud& cloud, const std::vector<Indices>& clusters, int step) {
  int left = cloud.width, right = 0, top = cloud.height, bottom = 0;
  for (const auto& cluster : clusters)
    for (const int i : cluster) {
      const int row = i / cloud.width, column = i - row * cloud.width;
      left = std::min(left, column), right = std::max(right, column);
      top = std::min(top, row), bottom = std::max(bottom, row);
    }
  Grid grid;
  grid.step = step;
  grid.image_width = cloud.width;
  grid.column = left / step * step;
  grid.row = top / step * step;
  grid.cloud = Cloud((right - grid.column) / step + 1, (bottom - grid.row) / step + 1, false);
  grid.cluster.assign(grid.cloud.size(), -1);
  for (std::size_t k = 0; k < clusters.size(); ++k)
    for (const int i : clusters[k]) {
      const auto [column, row] = grid.placeOf(i);
      const int cell = row * grid.cloud.width + column;
      if (grid.cluster[cell] >= 0) continue;
      grid.cluster[cell] = static_cast<int>(k);
      grid.cloud.setPoint(cell, cloud.point(i));
    }
  return grid;
}

/// Smooth patches of the grid, grown until they meet.
struct Patches {
  std::vector<int> patch;  ///< of each cell, -1 without
  std::vector<int> seed;  ///< the nearest cell inside the patch's smooth part, whose normal is good
  std::vector<int> sizes;  ///< cells of each patch
};

/// Connected cells whose normals differ little from one to the next and that lie on no edge.
Patches smoothPatches(const Grid& grid, const Normals& normals, const SplitOptions& options) {
  const auto min_cosine = static_cast<float>(std::cos(options.smooth_angle_deg * M_PI / 180));
  const auto gap = static_cast<float>(options.gap * options.gap);
  const auto smooth = [&](int i) { return normals.curvature[i] <= options.max_curvature; };
  UnionFind sets(grid.cells());
  visitNeighbors(grid, [&](int i, int j) {
    if (!smooth(i) || !smooth(j) || !grid.near(i, j, gap)) return;
    const float cosine =
        normals.x[i] * normals.x[j] + normals.y[i] * normals.y[j] + normals.z[i] * normals.z[j];
    if (cosine >= min_cosine) sets.join(i, j);
  });

  std::vector<int> counts(grid.cells(), 0);
  for (int i = 0; i < grid.cells(); ++i)
    if (smooth(i)) ++counts[sets.root(i)];
  const int least = std::max(1, options.min_patch_points / (grid.step * grid.step));
  Patches patches;
  patches.patch.assign(grid.cells(), -1);
  patches.seed.assign(grid.cells(), -1);
  std::vector<int> patch_of_root(grid.cells(), -1);
  for (int i = 0; i < grid.cells(); ++i) {
    if (!smooth(i)) continue;
    const int root = sets.root(i);
    if (counts[root] < least) continue;
    if (patch_of_root[root] < 0) {
      patch_of_root[root] = static_cast<int>(patches.sizes.size());
      patches.sizes.push_back(0);
    }
    patches.patch[i] = patch_of_root[root];
    patches.seed[i] = i;
    ++patches.sizes[patches.patch[i]];
  }
  return patches;
}

/// Grows the patches evenly, a cell at a time, over the edges and the noise between them. Cells
/// that no patch reaches become patches of their own, without seeds.
void growPatches(const Grid& grid, double max_gap, Patches& patches) {
  const auto gap = static_cast<float>(max_gap * max_gap);
  const int width = grid.cloud.width;
  std::vector<int> queue;
  for (int i = 0; i < grid.cells(); ++i)
    if (patches.patch[i] >= 0) queue.push_back(i);
  const auto growFrom = [&](std::size_t next) {
    for (; next < queue.size(); ++next) {
      const int i = queue[next];
      const auto take = [&](int j) {
        if (grid.cluster[j] < 0 || patches.patch[j] >= 0 || !grid.near(i, j, gap)) return;
        patches.patch[j] = patches.patch[i];
        patches.seed[j] = patches.seed[i];
        ++patches.sizes[patches.patch[j]];
        queue.push_back(j);
      };
      if (i % width > 0) take(i - 1);
      if (i % width + 1 < width) take(i + 1);
      if (i >= width) take(i - width);
      if (i + width < grid.cells()) take(i + width);
    }
  };
  growFrom(0);
  for (int i = 0; i < grid.cells(); ++i) {
    if (grid.cluster[i] < 0 || patches.patch[i] >= 0) continue;
    patches.patch[i] = static_cast<int>(patches.sizes.size());
    patches.sizes.push_back(1);
    queue.push_back(i);
    growFrom(queue.size() - 1);
  }
}

/// Whether the surfaces at two points belong to one convex thing: 1 for a convex or flat edge,
/// falling to -1 for a hollow of twice `limit` [rad].
double convexity(const Eigen::Vector3f& a, const Eigen::Vector3f& normal_a,
                 const Eigen::Vector3f& b, const Eigen::Vector3f& normal_b, double limit) {
  const Eigen::Vector3f line = (a - b).normalized();
  const double angle_a = std::acos(std::clamp(normal_a.dot(line), -1.0f, 1.0f));
  const double angle_b = std::acos(std::clamp(normal_b.dot(line), -1.0f, 1.0f));
  return std::clamp((angle_b - angle_a) / limit + 1, -1.0, 1.0);
}

RegionGraph graphOf(const Grid& grid, const Normals& normals, const Patches& patches,
                    const SplitOptions& options) {
  const auto gap = static_cast<float>(options.gap * options.gap);
  const double limit = options.concave_angle_deg * M_PI / 180;
  const auto normal = [&](int i) {
    return Eigen::Vector3f(normals.x[i], normals.y[i], normals.z[i]);
  };
  RegionGraph graph(patches.sizes);
  visitNeighbors(grid, [&](int i, int j) {
    if (patches.patch[i] == patches.patch[j] || !grid.near(i, j, gap)) return;
    const int a = patches.seed[i], b = patches.seed[j];
    const bool known = a >= 0 && b >= 0;
    graph.addBorder(
        patches.patch[i], patches.patch[j],
        known ? convexity(grid.cloud.point(a), normal(a), grid.cloud.point(b), normal(b), limit)
              : 0);
  });
  return graph;
}

/// The part that each point of a cluster belongs to: that of its own cell or, if that lies across a
/// step in depth, of the nearest of the cells around.
int partNear(const Cloud& cloud, int i, int cluster, const Grid& grid,
             const std::vector<int>& part_of_cell) {
  constexpr float SAME_SURFACE = 0.008f * 0.008f;  // [m^2]
  const auto [column, row] = grid.placeOf(i);
  const int own = row * grid.cloud.width + column;
  const Eigen::Vector3f p = cloud.point(i);
  if (grid.cluster[own] == cluster && (grid.cloud.point(own) - p).squaredNorm() < SAME_SURFACE)
    return part_of_cell[own];
  int nearest = -1;
  float least = 0;
  for (int v = std::max(0, row - 1); v <= std::min(grid.cloud.height - 1, row + 1); ++v)
    for (int u = std::max(0, column - 1); u <= std::min(grid.cloud.width - 1, column + 1); ++u) {
      const int cell = v * grid.cloud.width + u;
      if (grid.cluster[cell] != cluster) continue;
      const float squared = (grid.cloud.point(cell) - p).squaredNorm();
      if (nearest >= 0 && squared >= least) continue;
      nearest = cell;
      least = squared;
    }
  return nearest < 0 ? -1 : part_of_cell[nearest];
}

}  // namespace

std::vector<Indices> splitClusters(const Cloud& cloud, const std::vector<Indices>& clusters,
                                   const SplitOptions& options) {
  checkOptions("split", options);
  if (!options.enabled || !cloud.organized() || clusters.empty()) return clusters;

  const int step = stepOf(cloud, clusters, options.spacing_deg);
  const Grid grid = gridOf(cloud, clusters, step);
  NormalsOptions normals_options;
  normals_options.window = options.window;
  normals_options.step = 1;  // the grid is as sparse as it should be
  const Normals normals = computeNormals(grid.cloud, Eigen::Vector3f::Zero(), normals_options);
  Patches patches = smoothPatches(grid, normals, options);
  growPatches(grid, options.gap, patches);
  RegionGraph graph = graphOf(grid, normals, patches, options);
  graph.joinByVotes();
  graph.absorbSmall(options.min_points / (step * step));

  std::vector<int> part_of_cell(grid.cells(), -1);
  for (int i = 0; i < grid.cells(); ++i)
    if (patches.patch[i] >= 0) part_of_cell[i] = graph.find(patches.patch[i]);
  std::vector<Indices> parts(patches.sizes.size());
  for (std::size_t k = 0; k < clusters.size(); ++k)
    for (const int i : clusters[k]) {
      const int part = partNear(cloud, i, static_cast<int>(k), grid, part_of_cell);
      if (part >= 0) parts[part].push_back(i);
    }
  const auto scattered = [&](const Indices& part) {
    return static_cast<int>(part.size()) < options.min_points;
  };
  parts.erase(std::remove_if(parts.begin(), parts.end(), scattered), parts.end());
  std::stable_sort(parts.begin(), parts.end(),
                   [](const Indices& a, const Indices& b) { return a.size() > b.size(); });
  return parts;
}

}  // namespace tabletop_perception
