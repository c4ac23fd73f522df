#include "tabletop_perception/cloud.h"

#include <algorithm>

namespace tabletop_perception {
namespace {

/// Calls copy(from, count, to) for each stretch of consecutive indices: most points that are
/// selected come in rows.
template <typename Copy>
void forStretches(const Indices& indices, Copy copy) {
  for (std::size_t to = 0; to < indices.size();) {
    std::size_t count = 1;
    while (to + count < indices.size() &&
           indices[to + count] == indices[to] + static_cast<int>(count))
      ++count;
    copy(static_cast<std::size_t>(indices[to]), count, to);
    to += count;
  }
}

}  // namespace

Cloud::Cloud(int width, int height, bool colored) : width(width), height(height) {
  const auto n = static_cast<std::size_t>(width) * height;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  x.assign(n, nan);
  y.assign(n, nan);
  z.assign(n, nan);
  if (colored) rgb.assign(n, 0);
}

Indices validIndices(const Cloud& cloud) {
  Indices valid(cloud.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    valid[count] = static_cast<int>(i);  // kept only if the next line counts it
    count += cloud.valid(i);
  }
  valid.resize(count);
  return valid;
}

std::vector<Eigen::Vector3f> pointsAt(const Cloud& cloud, const Indices& indices) {
  std::vector<Eigen::Vector3f> points;
  points.reserve(indices.size());
  for (const int i : indices) points.push_back(cloud.point(i));
  return points;
}

Cloud selectPositions(const Cloud& cloud, const Indices& indices) {
  Cloud selected;
  selected.width = static_cast<int>(indices.size());
  selected.height = 1;
  for (auto* values : {&selected.x, &selected.y, &selected.z}) values->resize(indices.size());
  forStretches(indices, [&](std::size_t from, std::size_t count, std::size_t to) {
    std::copy_n(&cloud.x[from], count, &selected.x[to]);
    std::copy_n(&cloud.y[from], count, &selected.y[to]);
    std::copy_n(&cloud.z[from], count, &selected.z[to]);
  });
  return selected;
}

Cloud selectPoints(const Cloud& cloud, const Indices& indices) {
  Cloud selected = selectPositions(cloud, indices);
  if (!cloud.colored()) return selected;
  selected.rgb.resize(indices.size());
  forStretches(indices, [&](std::size_t from, std::size_t count, std::size_t to) {
    std::copy_n(&cloud.rgb[from], count, &selected.rgb[to]);
  });
  return selected;
}

Cloud decimated(const Cloud& cloud, int step) {
  Cloud coarse((cloud.width + step - 1) / step, (cloud.height + step - 1) / step, false);
  for (int row = 0; row < coarse.height; ++row)
    for (int column = 0; column < coarse.width; ++column)
      coarse.setPoint(row * coarse.width + column,
                      cloud.point(row * step * cloud.width + column * step));
  return coarse;
}

Cloud keepPoints(const Cloud& cloud, const Indices& indices) {
  Cloud kept(cloud.width, cloud.height, false);
  kept.rgb = cloud.rgb;
  for (const int i : indices) kept.setPoint(i, cloud.point(i));
  return kept;
}

}  // namespace tabletop_perception
