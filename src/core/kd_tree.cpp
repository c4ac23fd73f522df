#include "tabletop_perception/kd_tree.h"

#include <cstddef>

#include <nanoflann.hpp>

namespace tabletop_perception {
namespace {

struct Points {
  std::vector<Eigen::Vector3f> all;

  std::size_t kdtree_get_point_count() const { return all.size(); }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const { return all[i][axis]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Points>,
                                                 Points, 3, std::size_t>;

}  // namespace

struct KdTree::Index {
  explicit Index(std::vector<Eigen::Vector3f> points) : cloud{std::move(points)}, tree(3, cloud) {
    tree.buildIndex();
  }
  Points cloud;
  Tree tree;
};

KdTree::KdTree(std::vector<Eigen::Vector3f> points)
    : index_(std::make_unique<Index>(std::move(points))) {}
KdTree::~KdTree() = default;
KdTree::KdTree(KdTree&&) noexcept = default;

const std::vector<Eigen::Vector3f>& KdTree::points() const { return index_->cloud.all; }

KdTree::Neighbor KdTree::nearest(const Eigen::Vector3f& p) const {
  std::size_t index = 0;
  float squared_distance = 0;
  if (index_->tree.knnSearch(p.data(), 1, &index, &squared_distance) == 0) return {-1, 0};
  return {static_cast<int>(index), squared_distance};
}

void KdTree::nearest(const Eigen::Vector3f& p, int k, std::vector<Neighbor>& out) const {
  std::vector<std::size_t> indices(k);
  std::vector<float> distances(k);
  const auto found = index_->tree.knnSearch(p.data(), k, indices.data(), distances.data());
  out.clear();
  for (std::size_t i = 0; i < found; ++i)
    out.push_back({static_cast<int>(indices[i]), distances[i]});
}

void KdTree::within(const Eigen::Vector3f& p, double radius, std::vector<Neighbor>& out) const {
  std::vector<std::pair<std::size_t, float>> matches;
  nanoflann::SearchParams unsorted;
  unsorted.sorted = false;
  const auto squared = static_cast<float>(radius * radius);
  index_->tree.radiusSearch(p.data(), squared, matches, unsorted);
  out.clear();
  for (const auto& [index, distance] : matches) out.push_back({static_cast<int>(index), distance});
}

}  // namespace tabletop_perception
