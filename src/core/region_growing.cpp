#include "tabletop_perception/region_growing.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "radius_grid.h"
#include "tabletop_perception/kd_tree.h"

namespace tabletop_perception {
namespace {

/// The points around a point that may join its region, smooth or not.
class GridNeighbors {
 public:
  GridNeighbors(const Cloud& cloud, double gap)
      : cloud_(cloud), squared_gap_(static_cast<float>(gap * gap)) {}

  template <typename Visit>
  void visit(int i, Visit visit) {
    const int row = i / cloud_.width, column = i % cloud_.width;
    for (int v = std::max(0, row - 1); v <= std::min(cloud_.height - 1, row + 1); ++v)
      for (int u = std::max(0, column - 1); u <= std::min(cloud_.width - 1, column + 1); ++u) {
        const int j = v * cloud_.width + u;
        if ((cloud_.point(j) - cloud_.point(i)).squaredNorm() <= squared_gap_) visit(j);
      }
  }

 private:
  const Cloud& cloud_;
  float squared_gap_;
};

class TreeNeighbors {
 public:
  TreeNeighbors(const Cloud& cloud, double gap)
      : valid_(validIndices(cloud)), tree_(pointsAt(cloud, valid_)), cloud_(cloud), gap_(gap) {}

  template <typename Visit>
  void visit(int i, Visit visit) {
    tree_.within(cloud_.point(i), gap_, within_);
    for (const auto& neighbor : within_) visit(valid_[neighbor.index]);
  }

 private:
  Indices valid_;
  KdTree tree_;
  const Cloud& cloud_;
  double gap_;
  std::vector<KdTree::Neighbor> within_;
};

/// The points around each point of a surface, looked up once for curvature and growth.
class ListedNeighbors {
 public:
  ListedNeighbors(const Surface& surface, double gap) {
    const RadiusGrid near(surface.points, gap);
    begins_.push_back(0);
    for (const auto& p : surface.points) {
      near.appendWithin(p, neighbors_);
      begins_.push_back(neighbors_.size());
    }
  }

  std::size_t count(std::size_t i) const { return begins_[i + 1] - begins_[i]; }

  template <typename Visit>
  void visit(std::size_t i, Visit visit) const {
    for (std::size_t k = begins_[i]; k < begins_[i + 1]; ++k) visit(neighbors_[k]);
  }

 private:
  std::vector<std::size_t> begins_;  // of each point's neighbours, and the end
  Indices neighbors_;
};

/// How much the normals around each point cancel out.
std::vector<float> bendOf(const Surface& surface, const ListedNeighbors& neighbors) {
  std::vector<float> bend(surface.size());
  for (std::size_t i = 0; i < surface.size(); ++i) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    neighbors.visit(i, [&](int j) { sum += surface.normals[j]; });
    bend[i] = 1 - sum.norm() / static_cast<float>(neighbors.count(i));
  }
  return bend;
}

/// Points flat enough to grow from, flattest first.
Indices seedsOf(const Cloud& cloud, const Normals& normals, double max_curvature) {
  Indices seeds;
  for (const int i : validIndices(cloud))
    if (!std::isnan(normals.x[i]) && normals.curvature[i] <= max_curvature) seeds.push_back(i);
  std::stable_sort(seeds.begin(), seeds.end(),
                   [&](int a, int b) { return normals.curvature[a] < normals.curvature[b]; });
  return seeds;
}

template <typename Neighbors>
std::vector<Indices> grow(const Cloud& cloud, const Normals& normals,
                          const RegionGrowingOptions& options, Neighbors&& neighbors) {
  const auto min_cosine = static_cast<float>(std::cos(options.smooth_angle_deg * M_PI / 180));
  std::vector<bool> taken(cloud.size(), false);
  std::vector<Indices> regions;
  for (const int seed : seedsOf(cloud, normals, options.max_curvature)) {
    if (taken[seed]) continue;
    Indices region{seed};
    taken[seed] = true;
    for (std::size_t next = 0; next < region.size(); ++next) {
      const int i = region[next];
      if (!(normals.curvature[i] <= options.max_curvature)) continue;
      neighbors.visit(i, [&](int j) {
        const float cosine =
            normals.x[i] * normals.x[j] + normals.y[i] * normals.y[j] + normals.z[i] * normals.z[j];
        if (taken[j] || !(cosine >= min_cosine)) return;  // NaN: no normal
        taken[j] = true;
        region.push_back(j);
      });
    }
    const auto size = static_cast<long>(region.size());
    if (size < options.min_points || size > options.max_points) continue;
    std::sort(region.begin(), region.end());
    regions.push_back(std::move(region));
  }
  std::sort(regions.begin(), regions.end(), [](const Indices& a, const Indices& b) {
    return a.size() != b.size() ? a.size() > b.size() : a.front() < b.front();
  });
  return regions;
}

}  // namespace

std::vector<Indices> growRegions(const Cloud& cloud, const Normals& normals,
                                 const RegionGrowingOptions& options) {
  checkOptions("region_growing", options);
  if (normals.x.size() != cloud.size())
    throw std::invalid_argument("growRegions needs a normal per point, got " +
                                std::to_string(normals.x.size()) + " for " +
                                std::to_string(cloud.size()) + " points");
  return cloud.organized() ? grow(cloud, normals, options, GridNeighbors(cloud, options.gap))
                           : grow(cloud, normals, options, TreeNeighbors(cloud, options.gap));
}

std::vector<Indices> growRegions(const Surface& surface, const RegionGrowingOptions& options) {
  checkOptions("region_growing", options);
  const ListedNeighbors neighbors(surface, options.gap);
  Cloud cloud(static_cast<int>(surface.size()), 1, false);
  Normals normals{{}, {}, {}, bendOf(surface, neighbors)};
  for (std::size_t i = 0; i < surface.size(); ++i) {
    cloud.setPoint(i, surface.points[i]);
    normals.x.push_back(surface.normals[i].x());
    normals.y.push_back(surface.normals[i].y());
    normals.z.push_back(surface.normals[i].z());
  }
  return grow(cloud, normals, options, neighbors);
}

}  // namespace tabletop_perception
