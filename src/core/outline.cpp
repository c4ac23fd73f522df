#include "outline.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tabletop_perception {
namespace {

constexpr double REACH = 0.03;        // of what counts as the thing about a model [m]
constexpr float MIN_HEIGHT = 0.005f;  // of it above the table [m]
constexpr int CLOSED = 2;       // gaps between the model's points, at most twice this [pixels]
constexpr float SLACK = 0.015;  // by which what hides the model is nearer [m]
constexpr double PATCH = 0.02;  // over which errors are alike, about [m]
constexpr double WEIGHT = 0.5;
constexpr float NOWHERE = std::numeric_limits<float>::infinity();

/// Makes each value the least of those up to CLOSED before and after it in its line.
void spreadLeast(std::vector<float>& values, int lines, int line_step, int length, int step) {
  std::vector<float> line(static_cast<std::size_t>(length) + 2 * CLOSED, NOWHERE);
  for (int l = 0; l < lines; ++l) {
    float* first = &values[static_cast<std::size_t>(l) * line_step];
    for (int i = 0; i < length; ++i) line[i + CLOSED] = first[static_cast<std::size_t>(i) * step];
    for (int i = 0; i < length; ++i) {
      float least = line[i];
      for (int k = 1; k <= 2 * CLOSED; ++k) least = std::min(least, line[i + k]);
      first[static_cast<std::size_t>(i) * step] = least;
    }
  }
}

void spreadLeast(std::vector<float>& image, int width, int height) {
  spreadLeast(image, height, width, width, 1);
  spreadLeast(image, width, 1, height, width);
}

}  // namespace

SeenOutline::SeenOutline(const Observation& observation, const ModelIndex& index, int model,
                         const Eigen::Isometry3d& T_camera_model)
    : observation_(observation),
      model_(index.models()[model].surface),
      T_patches_camera_(T_camera_model.inverse().cast<float>()) {
  const auto& projection = *observation.projection;
  const Eigen::Isometry3f T = T_camera_model.cast<float>();
  Eigen::AlignedBox2d box;
  double nearest_z = NOWHERE;
  for (const auto& point : model_.points) {
    const Eigen::Vector3d p = (T * point).cast<double>();
    if (!(p.z() * projection.forward > 0)) continue;
    box.extend(projection.pixel(p));
    nearest_z = std::min(nearest_z, std::abs(p.z()));
  }
  if (box.isEmpty()) return;
  const double margin = REACH * std::abs(projection.fx) / nearest_z;
  const auto within = [](double pixel, int size) {
    return static_cast<int>(std::clamp(pixel, 0.0, static_cast<double>(size)));
  };
  left_ = within(box.min().x() - margin, projection.width);
  top_ = within(box.min().y() - margin, projection.height);
  width_ = within(box.max().x() + margin + 1, projection.width) - left_;
  height_ = within(box.max().y() + margin + 1, projection.height) - top_;
  thing_.assign(static_cast<std::size_t>(width_) * height_, 0);
  const NearestGrid& grid = index.grid(model);
  const Cloud& scene = observation.scene;
  for (int row = 0; row < height_; ++row)
    for (int column = 0; column < width_; ++column) {
      const std::size_t i = pixelAt(column, row);
      if (!((*observation.sightings)[i].height > MIN_HEIGHT)) continue;
      const Eigen::Vector3f p =
          T_patches_camera_ * Eigen::Vector3f(scene.x[i], scene.y[i], scene.z[i]);
      const int nearest = grid.nearest(p);
      thing_[at(column, row)] = nearest >= 0 && (model_.points[nearest] - p).norm() < REACH;
    }
}

std::vector<float> SeenOutline::rangesAt(const Eigen::Isometry3d& T_camera_model) const {
  const auto& projection = *observation_.projection;
  const Eigen::Isometry3f T = T_camera_model.cast<float>();
  const auto fx = static_cast<float>(projection.fx), fy = static_cast<float>(projection.fy);
  const auto right = static_cast<float>(projection.cx - left_ + 0.5);
  const auto down = static_cast<float>(projection.cy - top_ + 0.5);
  std::vector<float> ranges(thing_.size(), NOWHERE);
  for (const auto& point : model_.points) {
    const Eigen::Vector3f p = T * point;
    if (!(p.z() * static_cast<float>(projection.forward) > 0)) continue;
    const float column = fx * p.x() / p.z() + right, row = fy * p.y() / p.z() + down;
    if (!(column >= 0 && column < static_cast<float>(width_) && row >= 0 &&
          row < static_cast<float>(height_)))
      continue;
    float& range = ranges[at(static_cast<int>(column), static_cast<int>(row))];
    range = std::min(range, p.norm());
  }
  return ranges;
}

OffOutline SeenOutline::offAt(const Eigen::Isometry3d& T_camera_model) const {
  const auto& projection = *observation_.projection;
  const Cloud& scene = observation_.scene;
  std::vector<float> ranges = rangesAt(T_camera_model);
  // Spread, and drawn in again, so that gaps close and the outline stays where it is.
  spreadLeast(ranges, width_, height_);
  std::vector<float> covered(ranges.size());
  for (std::size_t i = 0; i < ranges.size(); ++i) covered[i] = ranges[i] < NOWHERE ? 1 : 0;
  spreadLeast(covered, width_, height_);

  OffOutline off;
  const auto note = [&](const Eigen::Vector3f& p) {
    ++off.pixels;
    ++off.by_patch[VoxelKey::of(T_patches_camera_ * p, 1 / PATCH)];
  };
  for (int row = 0; row < height_; ++row)
    for (int column = 0; column < width_; ++column) {
      const std::size_t here = at(column, row);
      if ((covered[here] > 0) == (thing_[here] != 0)) continue;
      const std::size_t i = pixelAt(column, row);
      if (thing_[here]) {
        note({scene.x[i], scene.y[i], scene.z[i]});
        continue;
      }
      if (!((*observation_.sightings)[i].range > ranges[here] - SLACK)) continue;  // nor NaN
      const Eigen::Vector3d ray((column + left_ - projection.cx) / projection.fx,
                                (row + top_ - projection.cy) / projection.fy, 1);
      note((projection.forward * ranges[here] * ray.normalized()).cast<float>());
    }
  return off;
}

double outlineCost(const OffOutline& outline, const OffOutline& other) {
  auto against = outline.by_patch;
  for (const auto& [patch, pixels] : other.by_patch) against[patch] -= pixels;
  double sum = 0, squares = 0;
  for (const auto& [patch, pixels] : against) {
    sum += pixels;
    squares += static_cast<double>(pixels) * pixels;
  }
  // What chance alone makes of equal outlines, 1 in the mean, says nothing.
  return squares > 0 ? WEIGHT * std::max(0.0, sum * sum / squares - 1) / 2 : 0;
}

}  // namespace tabletop_perception
