#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "simd.h"
#include "tabletop_perception/match.h"

namespace tabletop_perception {
namespace {

constexpr int LANES = 16;           // sums that are taken at once
constexpr float MIN_ROLL_SUM = 10;  // of a camera-roll histogram that says something, of 100
constexpr float ROLL_PEAK = 0.5f;   // least height of a peak over the mean, share of the highest's
constexpr double BIN_ANGLE = 2 * M_PI / ROLL_BINS;  // [rad]

/// Sums `term` over two histograms in a fixed order that vectorises.
template <typename Term>
inline float sumOver(const float* a, const float* b, int size, Term term) {
  std::array<float, LANES> sums{};
  int i = 0;
  for (; i + LANES <= size; i += LANES)
    for (int lane = 0; lane < LANES; ++lane) sums[lane] += term(a[i + lane], b[i + lane]);
  float sum = 0;
  for (; i < size; ++i) sum += term(a[i], b[i]);
  for (const float part : sums) sum += part;
  return sum;
}

TABLETOP_SIMD_CLONES
float l1(const float* a, const float* b, int size) {
  return sumOver(a, b, size, [](float x, float y) { return std::fabs(x - y); });
}

TABLETOP_SIMD_CLONES
float squaredL2(const float* a, const float* b, int size) {
  return sumOver(a, b, size, [](float x, float y) { return (x - y) * (x - y); });
}

TABLETOP_SIMD_CLONES
float chiSquare(const float* a, const float* b, int size) {
  constexpr float NOT_ZERO = 1e-30f;  // where both are, so is the difference
  return sumOver(a, b, size,
                 [](float x, float y) { return (x - y) * (x - y) / (x + y + NOT_ZERO); });
}

float l2(const float* a, const float* b, int size) { return std::sqrt(squaredL2(a, b, size)); }

using Metric = float (*)(const float*, const float*, int);

Metric metricOf(const std::string& name) {
  checkOption("match.metric", name, Choices{{"l1", "l2", "chi_square"}});
  if (name == "l1") return l1;
  return name == "l2" ? l2 : chiSquare;
}

bool isOfSize(const ModelIndex::Entry& entry, double extent, const MatchOptions& options) {
  return extent <= options.max_size_ratio * entry.extent &&
         extent >= options.min_size_ratio * entry.extent;
}

/// Turns a direction to z, as the camera-roll histogram does.
Eigen::Matrix3d toViewingAxis(const Eigen::Vector3f& centroid) {
  return rotationBetween(centroid.cast<double>().normalized(), Eigen::Vector3d::UnitZ());
}

/// How well two histograms agree when the first is turned on by each number of bins.
std::array<float, ROLL_BINS> correlation(const float* of_view, const float* of_cluster) {
  std::array<float, 2 * ROLL_BINS> twice;
  std::copy(of_cluster, of_cluster + ROLL_BINS, twice.begin());
  std::copy(of_cluster, of_cluster + ROLL_BINS, twice.begin() + ROLL_BINS);
  std::array<float, ROLL_BINS> sums{};
  for (int i = 0; i < ROLL_BINS; ++i)
    for (int shift = 0; shift < ROLL_BINS; ++shift) sums[shift] += of_view[i] * twice[i + shift];
  return sums;
}

}  // namespace

double histogramDistance(const float* a, const float* b, int size, const std::string& metric) {
  return metricOf(metric)(a, b, size);
}

std::vector<Neighbor> nearestViews(const Descriptor& descriptor, double extent,
                                   const ModelIndex& index, const MatchOptions& options) {
  const auto& vectors = index.vectors(descriptor.kind);
  const Metric metric = metricOf(options.metric);
  if (vectors.dimension != static_cast<int>(descriptor.values.size())) return {};
  std::vector<std::pair<float, std::size_t>> near;  // equal distances: the first row comes first
  for (std::size_t row = 0; row < vectors.entries.size(); ++row) {
    if (!isOfSize(vectors.entries[row], extent, options)) continue;
    const float distance =
        metric(descriptor.values.data(), vectors.values.data() + row * vectors.dimension,
               vectors.dimension);
    if (distance <= options.max_distance) near.emplace_back(distance, row);
  }
  const auto count = std::min<std::size_t>(near.size(), options.neighbors);
  std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count), near.end());
  near.resize(count);

  std::vector<Neighbor> neighbors;
  for (const auto& [distance, row] : near) {
    const auto& entry = vectors.entries[row];
    neighbors.push_back(
        {entry.model, entry.view, entry.centroid, descriptor.centroid, distance, std::nullopt});
    if (entry.axes && descriptor.axes)
      neighbors.back().R_camera_view = *descriptor.axes * entry.axes->transpose();
  }
  return neighbors;
}

Eigen::Isometry3d poseFromView(const Neighbor& neighbor, const View& view, double roll) {
  const Eigen::Vector3d seen = neighbor.cluster_centroid.cast<double>();
  const Eigen::Vector3d trained = neighbor.view_centroid.cast<double>();
  const Eigen::Matrix3d R =
      neighbor.R_camera_view
          ? Eigen::Quaterniond(neighbor.R_camera_view->cast<double>()).normalized().matrix()
          : Eigen::Matrix3d(Eigen::AngleAxisd(roll, seen.normalized()) *
                            rotationBetween(trained.normalized(), seen.normalized()));
  Eigen::Isometry3d T_camera_view = Eigen::Isometry3d::Identity();
  T_camera_view.linear() = R;
  T_camera_view.translation() = seen - R * trained;
  return T_camera_view * view.T_view_object;
}

std::vector<double> rollsFromHistograms(const float* of_cluster, const float* of_view,
                                        const Neighbor& neighbor) {
  for (const auto* histogram : {of_cluster, of_view})
    if (std::accumulate(histogram, histogram + ROLL_BINS, 0.0f) < MIN_ROLL_SUM) return {};
  const auto sums = correlation(of_view, of_cluster);
  const float mean = std::accumulate(sums.begin(), sums.end(), 0.0f) / ROLL_BINS;
  const float highest = *std::max_element(sums.begin(), sums.end());
  std::vector<std::pair<float, int>> peaks;  // highest first
  for (int k = 0; k < ROLL_BINS; ++k) {
    const float before = sums[(k + ROLL_BINS - 1) % ROLL_BINS], after = sums[(k + 1) % ROLL_BINS];
    const bool is_peak = sums[k] > before && sums[k] >= after;
    if (is_peak && sums[k] - mean >= ROLL_PEAK * (highest - mean)) peaks.emplace_back(-sums[k], k);
  }
  std::sort(peaks.begin(), peaks.end());

  // What the histograms call a turn of zero is a turn about the axis for rotationBetween.
  const Eigen::Vector3d seen = neighbor.cluster_centroid.cast<double>().normalized();
  const Eigen::Vector3d trained = neighbor.view_centroid.cast<double>().normalized();
  const Eigen::Matrix3d straight = toViewingAxis(neighbor.cluster_centroid) *
                                   rotationBetween(trained, seen) *
                                   toViewingAxis(neighbor.view_centroid).transpose();
  const double zero = std::atan2(straight(1, 0), straight(0, 0));
  std::vector<double> rolls;
  for (const auto& [height, bin] : peaks) rolls.push_back(bin * BIN_ANGLE - zero);
  return rolls;
}

namespace {

/// The turns about the viewing axis that a neighbour is tried at.
std::vector<double> rollsFor(const Neighbor& neighbor, const Descriptor* of_cluster,
                             const ModelIndex& index, const MatchOptions& options) {
  if (neighbor.R_camera_view) return {0};
  const float* of_view = index.cameraRoll(neighbor.model, neighbor.view);
  std::vector<double> rolls;
  if (options.roll == "histogram" && of_cluster && of_view)
    rolls = rollsFromHistograms(of_cluster->values.data(), of_view, neighbor);
  if (rolls.size() > static_cast<std::size_t>(options.rolls)) rolls.resize(options.rolls);
  if (rolls.empty())
    for (int step = 0; step < options.rolls; ++step)
      rolls.push_back(2 * M_PI * step / options.rolls);
  return rolls;
}

}  // namespace

ViewPoses posesFromViews(const std::vector<Descriptor>& descriptors, double extent,
                         const ModelIndex& index, const MatchOptions& options) {
  const auto kinds = splitWords(options.kinds);
  const Descriptor* roll = nullptr;
  for (const auto& descriptor : descriptors)
    if (descriptor.kind == "camera_roll") roll = &descriptor;

  ViewPoses found;
  for (const auto& descriptor : descriptors) {
    if (std::find(kinds.begin(), kinds.end(), descriptor.kind) == kinds.end()) continue;
    const auto& entries = index.vectors(descriptor.kind).entries;
    found.any_of_size =
        found.any_of_size || std::any_of(entries.begin(), entries.end(), [&](const auto& entry) {
          return isOfSize(entry, extent, options);
        });
    for (const auto& neighbor : nearestViews(descriptor, extent, index, options)) {
      const View& view = index.models()[neighbor.model].views[neighbor.view];
      for (const double turn : rollsFor(neighbor, roll, index, options))
        found.poses.push_back(
            {neighbor.model, poseFromView(neighbor, view, turn), neighbor.distance});
    }
  }
  return found;
}

}  // namespace tabletop_perception
