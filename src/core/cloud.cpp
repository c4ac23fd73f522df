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

Rgb rgbOf(std::uint32_t color) {
  return {static_cast<float>(color >> 16 & 255), static_cast<float>(color >> 8 & 255),
          static_cast<float>(color & 255)};
}

bool hasHues(const Cloud& cloud) {
  for (std::size_t i = 0; i < cloud.rgb.size(); ++i) {
    const std::uint32_t color = cloud.rgb[i];
    if (cloud.valid(i) && (color & 0xFFFF) != (color >> 8 & 0xFFFF)) return true;
  }
  return false;
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

namespace {

/// Copies every STEP-th value: a compiler makes vector code of steps that it knows.
template <int STEP, typename Value>
void copyEvery(const Value* from, int count, Value* to) {
  for (int i = 0; i < count; ++i) to[i] = from[i * STEP];
}

template <typename Value>
void copyEvery(int step, const Value* from, int count, Value* to) {
  switch (step) {
    case 1:
      return std::copy_n(from, count, to), void();
    case 2:
      return copyEvery<2>(from, count, to);
    case 3:
      return copyEvery<3>(from, count, to);
  }
  for (int i = 0; i < count; ++i) to[i] = from[i * step];
}

/// Every step-th value of every step-th row of a part of an image of `whole_width` columns.
template <typename Value>
std::vector<Value> decimated(const std::vector<Value>& values, int whole_width,
                             const PixelRectangle& part, int step) {
  const int columns = (part.width + step - 1) / step;
  std::vector<Value> kept(static_cast<std::size_t>(columns) * ((part.height + step - 1) / step));
  Value* to = kept.data();
  for (int row = part.row; row < part.row + part.height; row += step, to += columns)
    copyEvery(step, &values[static_cast<std::size_t>(row) * whole_width + part.column], columns,
              to);
  return kept;
}

Cloud decimatedPositions(const Cloud& cloud, const PixelRectangle& part, int step) {
  Cloud coarse;
  coarse.width = (part.width + step - 1) / step;
  coarse.height = (part.height + step - 1) / step;
  coarse.x = decimated(cloud.x, cloud.width, part, step);
  coarse.y = decimated(cloud.y, cloud.width, part, step);
  coarse.z = decimated(cloud.z, cloud.width, part, step);
  return coarse;
}

}  // namespace

Cloud decimated(const Cloud& cloud, int step) {
  return decimatedPositions(cloud, {0, 0, cloud.width, cloud.height}, step);
}

Cloud decimated(const Cloud& cloud, const PixelRectangle& part, int step) {
  Cloud coarse = decimatedPositions(cloud, part, step);
  if (cloud.colored()) coarse.rgb = decimated(cloud.rgb, cloud.width, part, step);
  return coarse;
}

Cloud keepPoints(const Cloud& cloud, const Indices& indices) {
  Cloud kept(cloud.width, cloud.height, false);
  kept.rgb = cloud.rgb;
  for (const int i : indices) kept.setPoint(i, cloud.point(i));
  return kept;
}

}  // namespace tabletop_perception
