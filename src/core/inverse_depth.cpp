#include "inverse_depth.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <limits>

#include "simd.h"

namespace tabletop_perception {
namespace {

/// The value that decimated() puts in place of a square's, which are given row by row. `valid`:
/// room to work in.
float surfaceMean(const std::vector<float>& square, float edge, std::vector<float>& valid) {
  constexpr float NONE = std::numeric_limits<float>::quiet_NaN();
  valid.clear();
  std::copy_if(square.begin(), square.end(), std::back_inserter(valid),
               [](float value) { return !std::isnan(value); });
  if (2 * valid.size() < square.size()) return NONE;
  const auto middle = valid.begin() + static_cast<std::ptrdiff_t>(valid.size() / 2);
  std::nth_element(valid.begin(), middle, valid.end());
  const auto on_surface = [median = *middle, edge](float value) {
    return std::abs(value - median) <= edge;
  };

  float sum = 0, pair_sum = 0;
  std::size_t count = 0, pair_count = 0;
  for (std::size_t i = 0; i < square.size(); ++i) {
    if (!on_surface(square[i])) continue;
    sum += square[i];
    ++count;
    // Pixels that are opposite each other have the centre's value on average, on any plane.
    if (!on_surface(square[square.size() - 1 - i])) continue;
    pair_sum += square[i];
    ++pair_count;
  }
  if (2 * count < square.size()) return NONE;
  return pair_count > 0 ? pair_sum / static_cast<float>(pair_count)
                        : sum / static_cast<float>(count);
}

/// Adds both neighbours of each pixel where they lie on a line with it.
TABLETOP_SIMD_CLONES
void addPairs(const float* middle, const float* before, const float* after, std::size_t count,
              float edge, float* sums, float* weights) {
  for (std::size_t i = 0; i < count; ++i) {
    const float pair = before[i] + after[i];
    const bool line = std::abs(pair - 2 * middle[i]) <= 2 * edge;
    sums[i] += zeroUnless(line, pair);
    weights[i] += zeroUnless(line, 2);
  }
}

TABLETOP_SIMD_CLONES
void mixIn(const float* before, std::size_t count, float weight, float edge, float* values) {
  for (std::size_t i = 0; i < count; ++i) {
    const float change = before[i] - values[i];
    values[i] += zeroUnless(std::abs(change) <= edge, weight * change);
  }
}

}  // namespace

InverseDepths decimated(const InverseDepths& depths, int side, float edge) {
  InverseDepths small{depths.width / side, depths.height / side, {}};
  small.values.reserve(static_cast<std::size_t>(small.width) * small.height);
  std::vector<float> square, valid;
  for (int v = 0; v < small.height; ++v)
    for (int u = 0; u < small.width; ++u) {
      square.clear();
      for (int k = 0; k < side; ++k) {
        const float* values = depths.row(v * side + k) + u * side;
        square.insert(square.end(), values, values + side);
      }
      small.values.push_back(surfaceMean(square, edge, valid));
    }
  return small;
}

InverseDepths smoothed(const InverseDepths& depths, int radius, float edge) {
  InverseDepths result = depths;
  std::vector<float> weights(depths.width);
  for (int v = 0; v < depths.height; ++v) {
    std::fill(weights.begin(), weights.end(), 1.f);
    float* sums = result.row(v);
    for (int dv = 0; dv <= radius && v - dv >= 0 && v + dv < depths.height; ++dv)
      for (int du = dv > 0 ? -radius : 1; du <= radius; ++du) {
        const int first = std::abs(du);
        if (2 * first >= depths.width) continue;
        addPairs(depths.row(v) + first, depths.row(v - dv) + first - du,
                 depths.row(v + dv) + first + du, depths.width - 2 * first, edge, sums + first,
                 &weights[first]);
      }
    for (int u = 0; u < depths.width; ++u) sums[u] /= weights[u];
  }
  return result;
}

void steady(InverseDepths& depths, float newest_weight, float edge, DepthMemory& memory) {
  if (memory.width == depths.width && memory.height == depths.height)
    mixIn(memory.inverse_depths.data(), depths.values.size(), 1 - newest_weight, edge,
          depths.values.data());
  memory = {depths.width, depths.height, depths.values};
}

void fillHoles(InverseDepths& depths, int max_hole, float edge) {
  for (int v = 0; v < depths.height; ++v) {
    float* values = depths.row(v);
    int last = -1;  // pixel with depth
    for (int u = 0; u < depths.width; ++u) {
      if (std::isnan(values[u])) continue;
      const int hole = u - last - 1;
      if (last >= 0 && hole > 0 && hole <= max_hole && std::abs(values[u] - values[last]) <= edge)
        for (int k = 1; k <= hole; ++k)
          values[last + k] =
              values[last] + (values[u] - values[last]) * static_cast<float>(k) / (hole + 1);
      last = u;
    }
  }
}

}  // namespace tabletop_perception
