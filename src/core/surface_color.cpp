#include "tabletop_perception/surface_color.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tabletop_perception {
namespace {

constexpr double RADIUS = 0.004;  // about a point within which a scene's colours are averaged [m]
constexpr int MAX_REACH = 6;      // of it at most [pixels]
constexpr int MIN_COMPARED = 20;  // points that tell whether colours are alike
constexpr float DARK = 20;        // brightness below which hues fade, 0 to 255
constexpr float MAX_LOG_GAIN = 1.1f;      // of the light on an object
constexpr float MAX_TINT = 0.05f;         // of it, as a difference of chromaticities
constexpr float CHROMA_NOISE = 0.06f;     // of like points
constexpr float BRIGHTNESS_NOISE = 0.5f;  // of their logarithms: shades, and faces off the light

/// The mean over the pixels about a point that lie on its surface; none where nothing was seen.
std::optional<Rgb> colorInPicture(const Observation& observation, const Eigen::Vector3f& p) {
  const Cloud& scene = observation.scene;
  const Projection& projection = *observation.projection;
  const Eigen::Vector2d pixel = projection.pixel(p.cast<double>());
  const int column = static_cast<int>(std::lround(pixel.x()));
  const int row = static_cast<int>(std::lround(pixel.y()));
  const int reach = std::min(MAX_REACH, static_cast<int>(RADIUS * std::abs(projection.fx / p.z())));
  // Every pixel is added, those off the surface as nothing: which ones are is hard to foresee for a
  // processor.
  constexpr auto LIMIT = static_cast<float>(2 * RADIUS * RADIUS);
  std::uint32_t red = 0, green = 0, blue = 0, count = 0;
  for (int v = std::max(0, row - reach); v <= std::min(scene.height - 1, row + reach); ++v)
    for (int u = std::max(0, column - reach); u <= std::min(scene.width - 1, column + reach); ++u) {
      const auto i = static_cast<std::size_t>(v) * scene.width + u;
      const float dx = scene.x[i] - p.x(), dy = scene.y[i] - p.y(), dz = scene.z[i] - p.z();
      const std::uint32_t on_surface = dx * dx + dy * dy + dz * dz <= LIMIT;  // not where it is NaN
      const std::uint32_t rgb = scene.rgb[i] & -on_surface;
      red += rgb >> 16 & 0xFF;
      green += rgb >> 8 & 0xFF;
      blue += rgb & 0xFF;
      count += on_surface;
    }
  if (count == 0) return std::nullopt;
  return Rgb(static_cast<float>(red), static_cast<float>(green), static_cast<float>(blue)) /
         static_cast<float>(count);
}

/// The colour of the point of an unorganised scene that is nearest.
std::optional<Rgb> colorAmongPoints(const Observation& observation, const Eigen::Vector3f& p) {
  const auto nearest = observation.points->nearest(p);
  if (nearest.index < 0 || nearest.squared_distance > 2 * RADIUS * RADIUS) return std::nullopt;
  return rgbOf(observation.scene.rgb[(*observation.point_indices)[nearest.index]]);
}

/// What is seen and what the model shows there.
struct Pair {
  Rgb seen, shown;
};

std::vector<Pair> pairsOf(const ModelIndex& index, int model,
                          const Eigen::Isometry3d& T_object_camera, const ColoredPoints& points,
                          double tolerance) {
  const auto& grid = index.grid(model);
  const auto& surface = index.models()[model].surface.points;
  const auto& colors = index.colors(model);
  const Eigen::Isometry3f T = T_object_camera.cast<float>();
  const auto max_squared = static_cast<float>(tolerance * tolerance);
  std::vector<Pair> pairs;
  pairs.reserve(points.points.size());
  for (std::size_t i = 0; i < points.points.size(); ++i) {
    const Eigen::Vector3f p = T * points.points[i];
    const int nearest = grid.nearest(p);
    if (nearest < 0 || (surface[nearest] - p).squaredNorm() > max_squared) continue;
    pairs.push_back({points.colors[i], colors[nearest]});
  }
  return pairs;
}

float brightnessOf(const Rgb& color) { return color.mean() + DARK; }

/// A colour without its brightness: zero for grey, and nearly so for what is too dark to tell.
Rgb chromaOf(const Rgb& color) {
  return (color.array() - color.mean()).matrix() / (3 * brightnessOf(color));
}

/// The mean over the pairs of how near they are, under the light that makes them most alike.
double likenessOf(std::vector<Pair> pairs) {
  const auto count = static_cast<float>(pairs.size());
  float log_gain = 0;
  for (const auto& pair : pairs)
    log_gain += std::log(brightnessOf(pair.seen) / brightnessOf(pair.shown));
  const float gain = std::exp(std::clamp(log_gain / count, -MAX_LOG_GAIN, MAX_LOG_GAIN));
  Rgb tint = Rgb::Zero();
  for (auto& pair : pairs) {
    pair.shown *= gain;
    tint += chromaOf(pair.seen) - chromaOf(pair.shown);
  }
  tint /= count;
  if (tint.norm() > MAX_TINT) tint *= MAX_TINT / tint.norm();
  double sum = 0;
  for (const auto& pair : pairs) {
    const float chroma = (chromaOf(pair.seen) - chromaOf(pair.shown) - tint).norm() / CHROMA_NOISE;
    const float brightness =
        std::log(brightnessOf(pair.seen) / brightnessOf(pair.shown)) / BRIGHTNESS_NOISE;
    sum += std::exp(-(chroma * chroma + brightness * brightness) / 2);
  }
  return sum / count;
}

}  // namespace

ColoredPoints coloredPoints(const Observation& observation,
                            const std::vector<Eigen::Vector3f>& points, std::size_t most) {
  ColoredPoints colored;
  if (!observation.colored) return colored;
  const std::size_t step = points.size() / most + 1;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const auto color = observation.projection ? colorInPicture(observation, points[i])
                                              : colorAmongPoints(observation, points[i]);
    if (!color) continue;
    colored.points.push_back(points[i]);
    colored.colors.push_back(*color);
  }
  return colored;
}

std::optional<double> colorLikeness(const ModelIndex& index, int model,
                                    const Eigen::Isometry3d& T_camera_object,
                                    const ColoredPoints& points, double tolerance) {
  if (index.colors(model).empty() || points.points.empty()) return std::nullopt;
  auto pairs = pairsOf(index, model, T_camera_object.inverse(), points, tolerance);
  if (static_cast<int>(pairs.size()) < MIN_COMPARED) return std::nullopt;
  return likenessOf(std::move(pairs));
}

std::optional<double> bestColorLikeness(const ModelIndex& index, int model,
                                        const Eigen::Isometry3d& T_camera_object,
                                        const ColoredPoints& points, double tolerance) {
  auto best = colorLikeness(index, model, T_camera_object, points, tolerance);
  if (!best) return best;
  for (const auto& motion : index.sparse(model).alike) {
    const auto other = colorLikeness(index, model, T_camera_object * motion, points, tolerance);
    if (other) best = std::max(*best, *other);
  }
  return best;
}

}  // namespace tabletop_perception
