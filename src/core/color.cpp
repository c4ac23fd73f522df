#include "tabletop_perception/color.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "union_find.h"

namespace tabletop_perception {
namespace {

/// The color of a pixel without its brightness.
struct Chroma {
  float x = 0, y = 0;    ///< unit vector at the angle of the hue: red wraps around by itself
  float saturation = 0;  ///< 0 to 1
  bool grey = true;      ///< x and y mean nothing
};

Chroma chromaOf(std::uint32_t rgb, const ColorOptions& options) {
  const int r = rgb >> 16 & 255, g = rgb >> 8 & 255, b = rgb & 255;
  const auto most = static_cast<float>(std::max({r, g, b}));
  const auto least = static_cast<float>(std::min({r, g, b}));
  Chroma chroma;
  chroma.saturation = most > 0 ? (most - least) / most : 0;
  chroma.grey = chroma.saturation < options.min_saturation || most < 255 * options.min_value;
  if (chroma.grey) return chroma;
  const float x = static_cast<float>(2 * r - g - b),
              y = std::sqrt(3.0f) * static_cast<float>(g - b);
  const float norm = std::sqrt(x * x + y * y);
  chroma.x = x / norm;
  chroma.y = y / norm;
  return chroma;
}

/// The mean color of a patch, as sums over its pixels.
struct ColorSum {
  double x = 0, y = 0, saturation = 0;
  int count = 0;

  void add(const ColorSum& other) {
    x += other.x, y += other.y, saturation += other.saturation;
    count += other.count;
  }
};

/// Patches of pixels side by side, each with its mean color.
class ColorPatches {
 public:
  ColorPatches(std::size_t most, const ColorOptions& options)
      : sets_(most),
        min_cosine_(std::cos(options.max_hue_deg * M_PI / 180)),
        max_saturation_(options.max_saturation) {}

  int start(const ColorSum& pixel) {
    sums_.push_back(pixel);
    return static_cast<int>(sums_.size()) - 1;
  }

  /// Whether a color is near the mean of a patch. The mean of hues is the direction of their sum.
  bool alike(int patch, const ColorSum& color) {
    const ColorSum& mean = sums_[sets_.root(patch)];
    const double lengths =
        std::sqrt((mean.x * mean.x + mean.y * mean.y) * (color.x * color.x + color.y * color.y));
    return mean.x * color.x + mean.y * color.y >= min_cosine_ * lengths &&
           std::abs(mean.saturation / mean.count - color.saturation / color.count) <=
               max_saturation_;
  }

  void add(int patch, const ColorSum& pixel) { sums_[sets_.root(patch)].add(pixel); }

  void joinIfAlike(int a, int b) {
    const int low = std::min(sets_.root(a), sets_.root(b));
    const int high = std::max(sets_.root(a), sets_.root(b));
    if (low == high || !alike(low, sums_[high])) return;
    sets_.join(low, high);
    sums_[low].add(sums_[high]);
  }

  int root(int patch) { return sets_.root(patch); }
  int size(int root) const { return sums_[root].count; }
  std::size_t count() const { return sums_.size(); }

 private:
  UnionFind sets_;
  std::vector<ColorSum> sums_;  // of each patch; those of roots are complete
  double min_cosine_, max_saturation_;
};

/// The cluster of each pixel, -1 without.
std::vector<int> clusterOfPixels(const Cloud& cloud, const std::vector<Indices>& clusters) {
  std::vector<int> cluster_of(cloud.size(), -1);
  for (std::size_t k = 0; k < clusters.size(); ++k)
    for (const int i : clusters[k]) cluster_of[i] = static_cast<int>(k);
  return cluster_of;
}

/// Whether a pixel lies within two of a step in depth or of the outline of the clusters: the color
/// image does not fit the depth image better than that.
bool besideEdge(const Cloud& cloud, const std::vector<int>& cluster_of, int i) {
  constexpr int MARGIN = 2;      // [pixels]
  constexpr float STEP = 0.02f;  // [m]
  const int column = i % cloud.width, row = i / cloud.width;
  if (column < MARGIN || column + MARGIN >= cloud.width) return true;
  if (row < MARGIN || row + MARGIN >= cloud.height) return true;
  for (int n = 1; n <= MARGIN; ++n)
    for (const int j : {i - n, i + n, i - n * cloud.width, i + n * cloud.width})
      if (cluster_of[j] < 0 || std::abs(cloud.z[j] - cloud.z[i]) > STEP) return true;
  return false;
}

bool usable(const Cloud& cloud, const std::vector<Indices>& clusters, const ColorOptions& options) {
  return options.enabled && cloud.organized() && cloud.colored() && !clusters.empty();
}

void sortBySize(std::vector<Indices>& clusters) {
  std::stable_sort(clusters.begin(), clusters.end(),
                   [](const Indices& a, const Indices& b) { return a.size() > b.size(); });
}

/// The point of a patch that is nearest to the middle of it.
int centerOf(const Cloud& cloud, const Indices& patch) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const int i : patch) sum += cloud.point(i);
  const Eigen::Vector3f middle = sum / static_cast<float>(patch.size());
  const auto distance = [&](int i) { return (cloud.point(i) - middle).squaredNorm(); };
  return *std::min_element(patch.begin(), patch.end(),
                           [&](int a, int b) { return distance(a) < distance(b); });
}

/// Grows parts evenly, a pixel at a time, over the pixels of their cluster. `part_of`: the part of
/// each pixel, -1 without; `queue`: the pixels that have one.
void growParts(const Cloud& cloud, const std::vector<int>& cluster_of, std::vector<int> queue,
               std::vector<int>& part_of) {
  for (std::size_t next = 0; next < queue.size(); ++next) {
    const int i = queue[next], column = i % cloud.width, row = i / cloud.width;
    const auto take = [&](int j) {
      if (cluster_of[j] != cluster_of[i] || part_of[j] >= 0) return;
      part_of[j] = part_of[i];
      queue.push_back(j);
    };
    if (column > 0) take(i - 1);
    if (column + 1 < cloud.width) take(i + 1);
    if (row > 0) take(i - cloud.width);
    if (row + 1 < cloud.height) take(i + cloud.width);
  }
}

}  // namespace

std::vector<Indices> colorClusters(const Cloud& cloud, const std::vector<Indices>& clusters,
                                   const ColorOptions& options) {
  checkOptions("color", options);
  if (!usable(cloud, clusters, options)) return {};
  const auto cluster_of = clusterOfPixels(cloud, clusters);
  const auto squared_gap = static_cast<float>(options.max_gap * options.max_gap);
  std::size_t points = 0;
  for (const auto& cluster : clusters) points += cluster.size();

  ColorPatches patches(points, options);
  std::vector<int> patch_of(cloud.size(), -1);
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
    if (cluster_of[i] < 0) continue;
    const Chroma chroma = chromaOf(cloud.rgb[i], options);
    if (chroma.grey) continue;
    const ColorSum pixel{chroma.x, chroma.y, chroma.saturation, 1};
    const auto fits = [&](int j) {
      return patch_of[j] >= 0 && (cloud.point(i) - cloud.point(j)).squaredNorm() <= squared_gap &&
             patches.alike(patch_of[j], pixel);
    };
    const bool left = i % cloud.width > 0 && fits(i - 1);
    const bool above = i >= cloud.width &&
                       !(left && patch_of[i - 1] == patch_of[i - cloud.width]) &&
                       fits(i - cloud.width);
    if (left && above) patches.joinIfAlike(patch_of[i - 1], patch_of[i - cloud.width]);
    if (left || above) {
      patch_of[i] = patch_of[left ? i - 1 : i - cloud.width];
      patches.add(patch_of[i], pixel);
    } else if (!besideEdge(cloud, cluster_of, i)) {
      patch_of[i] = patches.start(pixel);
    }
  }

  std::vector<Indices> colors;
  std::vector<int> color_of(patches.count(), -1);  // by root
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i) {
    if (patch_of[i] < 0) continue;
    const int root = patches.root(patch_of[i]);
    if (patches.size(root) < options.min_points) continue;
    if (color_of[root] < 0) {
      color_of[root] = static_cast<int>(colors.size());
      colors.emplace_back().reserve(patches.size(root));
    }
    colors[color_of[root]].push_back(i);
  }
  sortBySize(colors);
  return colors;
}

std::vector<Indices> mergeByColor(const Cloud& cloud, const std::vector<Indices>& clusters,
                                  const ColorOptions& options) {
  checkOptions("color", options);
  if (!options.merge || !usable(cloud, clusters, options)) return clusters;
  const auto cluster_of = clusterOfPixels(cloud, clusters);
  const int count = static_cast<int>(clusters.size());
  UnionFind sets(clusters.size());
  for (const auto& color : colorClusters(cloud, clusters, options)) {
    std::vector<int> covered(clusters.size(), 0);
    for (const int i : color) ++covered[cluster_of[i]];
    int first = -1;
    for (int k = 0; k < count; ++k) {
      if (covered[k] < options.min_cover * static_cast<double>(clusters[k].size())) continue;
      if (first < 0) first = k;
      sets.join(first, k);
    }
  }

  std::vector<Indices> merged(clusters.size());
  for (int k = 0; k < count; ++k) {
    Indices& into = merged[sets.root(k)];
    into.insert(into.end(), clusters[k].begin(), clusters[k].end());
  }
  merged.erase(
      std::remove_if(merged.begin(), merged.end(), [](const Indices& c) { return c.empty(); }),
      merged.end());
  if (merged.size() == clusters.size()) return clusters;
  for (auto& cluster : merged) std::sort(cluster.begin(), cluster.end());
  sortBySize(merged);
  return merged;
}

std::vector<Indices> splitByColor(const Cloud& cloud, const std::vector<Indices>& clusters,
                                  const ColorOptions& options) {
  checkOptions("color", options);
  if (!options.split || !usable(cloud, clusters, options)) return clusters;
  const auto cluster_of = clusterOfPixels(cloud, clusters);
  std::vector<int> part_of(cloud.size(), -1), queue;
  std::vector<int> largest(clusters.size(), -1);  // part of each cluster
  int parts = 0;
  for (const auto& color : colorClusters(cloud, clusters, options)) {
    const int cluster = cluster_of[centerOf(cloud, color)];
    Indices inside;
    for (const int i : color)
      if (cluster_of[i] == cluster) inside.push_back(i);
    if (static_cast<int>(inside.size()) < options.min_points) continue;
    for (const int i : inside) part_of[i] = parts;
    queue.insert(queue.end(), inside.begin(), inside.end());
    if (largest[cluster] < 0) largest[cluster] = parts;
    ++parts;
  }
  growParts(cloud, cluster_of, std::move(queue), part_of);

  std::vector<Indices> result(parts);
  for (std::size_t k = 0; k < clusters.size(); ++k) {
    if (largest[k] < 0) {  // no color in it
      result.push_back(clusters[k]);
      continue;
    }
    for (const int i : clusters[k]) result[part_of[i] < 0 ? largest[k] : part_of[i]].push_back(i);
  }
  if (result.size() == clusters.size()) return clusters;
  sortBySize(result);
  return result;
}

std::vector<Indices> colorCorrected(const Cloud& cloud, const std::vector<Indices>& clusters,
                                    const ColorOptions& options) {
  return splitByColor(cloud, mergeByColor(cloud, clusters, options), options);
}

}  // namespace tabletop_perception
