#include "pixel_votes.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace tabletop_perception {
namespace {

constexpr float SAME = 0.006f;        // in range, of what is seen and the model there [m]
constexpr float BEHIND = 0.011f;      // by which what is seen lies behind the model [m]
constexpr double HIDDEN = 0.25;       // of a vote against what is not seen for something nearer
constexpr float MIN_HEIGHT = 0.005f;  // above the table of what speaks for a model [m]
constexpr float MIN_DEPTH = 0.02f;    // of what is drawn [m]
constexpr float LEAF = 0.003f;        // side of what a point of a model stands for [m]
constexpr int MOST_DRAWN = 3;         // points along such a side
constexpr float NOWHERE = std::numeric_limits<float>::infinity();

/// The range of a model at a pose where a camera should see it, in the window that holds it.
class Rendering {
 public:
  Rendering(const Projection& camera, const Surface& model, const Eigen::Isometry3d& T_camera_model)
      : camera_(camera) {
    const Eigen::Isometry3f T = T_camera_model.cast<float>();
    Surface facing;
    Eigen::AlignedBox2d box;
    double nearest_z = NOWHERE;
    for (std::size_t i = 0; i < model.size(); ++i) {
      const Eigen::Vector3f p = T * model.points[i], n = T.linear() * model.normals[i];
      if (!(p.z() * static_cast<float>(camera.forward) > MIN_DEPTH) || n.dot(p) >= 0) continue;
      facing.points.push_back(p);
      facing.normals.push_back(n);
      box.extend(camera.pixel(p.cast<double>()));
      nearest_z = std::min<double>(nearest_z, std::abs(p.z()));
    }
    if (facing.empty()) return;
    const double focal = std::abs(camera.fx);
    const double pixels = LEAF * focal / nearest_z;  // along a side
    drawn_ = std::clamp(static_cast<int>(std::ceil(pixels)), 1, MOST_DRAWN);
    step_ = std::max(1, static_cast<int>(std::ceil(pixels / drawn_)));
    const double margin = pixels / 2 + 1;
    const auto within = [](double pixel, int size) {
      return static_cast<int>(std::clamp(pixel, 0.0, static_cast<double>(size)));
    };
    left_ = within(box.min().x() - margin, camera.width);
    top_ = within(box.min().y() - margin, camera.height);
    width_ = (within(box.max().x() + margin, camera.width) - left_) / step_;
    height_ = (within(box.max().y() + margin, camera.height) - top_) / step_;
    ranges_.assign(static_cast<std::size_t>(width_) * height_, NOWHERE);
    for (std::size_t i = 0; i < facing.size(); ++i) draw(facing.points[i], facing.normals[i]);
  }

  /// Calls visit(column, row, range, area) for the middle pixel of each square of pixels that shows
  /// the model; `area`: of the square, where the model is [m^2].
  template <typename Visit>
  void visitShown(Visit visit) const {
    const double side = step_ / std::abs(camera_.fx);  // at a range of 1 m
    for (int v = 0; v < height_; ++v)
      for (int u = 0; u < width_; ++u) {
        const float range = ranges_[static_cast<std::size_t>(v) * width_ + u];
        if (range < NOWHERE)
          visit(left_ + u * step_ + step_ / 2, top_ + v * step_ + step_ / 2, range,
                side * side * range * range);
      }
  }

 private:
  /// The surface about a point.
  void draw(const Eigen::Vector3f& p, const Eigen::Vector3f& n) {
    const float spacing = LEAF / static_cast<float>(drawn_);
    const Eigen::Vector3f across = n.unitOrthogonal() * spacing, along = n.cross(across);
    const float first = static_cast<float>(1 - drawn_) / 2;
    for (int i = 0; i < drawn_; ++i)
      for (int j = 0; j < drawn_; ++j) {
        const Eigen::Vector3f q =
            p + (first + static_cast<float>(i)) * across + (first + static_cast<float>(j)) * along;
        const float inverse_z = 1 / q.z();
        // Half a pixel on: the nearest is the one below.
        const float right = static_cast<float>(camera_.fx) * q.x() * inverse_z +
                            static_cast<float>(camera_.cx - left_ + 0.5);
        const float down = static_cast<float>(camera_.fy) * q.y() * inverse_z +
                           static_cast<float>(camera_.cy - top_ + 0.5);
        if (!(right >= 0 && right < static_cast<float>(width_ * step_) && down >= 0 &&
              down < static_cast<float>(height_ * step_)))
          continue;
        const int u = static_cast<int>(right) / step_, v = static_cast<int>(down) / step_;
        float& range = ranges_[static_cast<std::size_t>(v) * width_ + u];
        range = std::min(range, q.norm());
      }
  }

  const Projection& camera_;
  int drawn_ = 1;               ///< points along a side of what one of the model stands for
  int step_ = 1;                ///< side of the squares of pixels that are one [pixels]
  int left_ = 0, top_ = 0;      ///< of the window [pixels]
  int width_ = 0, height_ = 0;  ///< of it [squares]
  std::vector<float> ranges_;   ///< infinite where the model is not [m]
};

/// What a pixel says against a model at this range, from -1 to 1. Beside what the model would hide
/// or be hidden by it says nothing: an edge may be a pixel off.
double voteAgainst(const Observation& observation, int column, int row, float range) {
  const Projection& camera = *observation.projection;
  const SeenPoint* seen = &(*observation.sightings)[static_cast<std::size_t>(row) * camera.width];
  const float behind = seen[column].range - range;  // NaN where nothing was seen
  if (std::abs(behind) < SAME) return seen[column].height > MIN_HEIGHT ? -1 : 0;
  const bool is_behind = behind > BEHIND;
  if (!is_behind && !(behind < -SAME)) return 0;
  for (int v = std::max(0, row - 1); v <= std::min(camera.height - 1, row + 1); ++v) {
    seen = &(*observation.sightings)[static_cast<std::size_t>(v) * camera.width];
    for (int u = std::max(0, column - 1); u <= std::min(camera.width - 1, column + 1); ++u) {
      const float there = seen[u].range - range;
      if (is_behind ? there <= BEHIND : there >= -SAME) return 0;
    }
  }
  return is_behind ? 1 : HIDDEN;
}

}  // namespace

double votesAgainst(const Observation& observation, const Surface& model,
                    const Eigen::Isometry3d& T_camera_model) {
  double against = 0;
  Rendering(*observation.projection, model, T_camera_model)
      .visitShown([&](int column, int row, float range, double area) {
        against += voteAgainst(observation, column, row, range) * area;
      });
  return against;
}

}  // namespace tabletop_perception
