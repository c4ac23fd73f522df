#include "tabletop_perception/verify.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "tabletop_perception/kd_tree.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t MAX_MODEL_POINTS = 2500;  // of the surface that are held against the scene
constexpr float MIN_FACING = 0.2f;        // cosine to the viewing ray; flatter points say nothing
constexpr float MIN_NORMAL_DOT = 0.5f;    // of model and scene, either side of a thin wall
constexpr double OCCLUSION_CELL = 0.008;  // raster in which a model hides its own back [m]
constexpr double OCCLUSION_GAP = 0.012;   // and how much nearer the hiding part lies [m]

/// The part of the model that faces the camera and is not hidden behind the model itself, in the
/// camera's frame.
Surface facingSurface(const Surface& model, const Eigen::Isometry3d& T_camera_object) {
  const Surface all = transformed(model, T_camera_object);
  const std::size_t step = std::max<std::size_t>(1, all.size() / MAX_MODEL_POINTS);

  // A raster of viewing angles about the model's direction, as fine as OCCLUSION_CELL there.
  const Eigen::Vector3f center = T_camera_object.translation().cast<float>();
  const float range = std::max(0.05f, center.norm());
  const Eigen::Matrix3f to_axis =
      rotationBetween(center.cast<double>().normalized(), Eigen::Vector3d::UnitZ()).cast<float>();
  const int side = 256;
  const auto cellOf = [&](const Eigen::Vector3f& p) {
    const Eigen::Vector3f q = to_axis * p;
    const float scale = range / (static_cast<float>(OCCLUSION_CELL) * std::max(q.z(), 0.01f));
    const int u = std::clamp(static_cast<int>(q.x() * scale) + side / 2, 0, side - 1);
    const int v = std::clamp(static_cast<int>(q.y() * scale) + side / 2, 0, side - 1);
    return static_cast<std::size_t>(v) * side + u;
  };
  std::vector<float> nearest(static_cast<std::size_t>(side) * side,
                             std::numeric_limits<float>::max());
  for (const auto& p : all.points) {
    float& best = nearest[cellOf(p)];
    best = std::min(best, p.norm());
  }

  Surface facing;
  for (std::size_t i = 0; i < all.size(); i += step) {
    const Eigen::Vector3f& p = all.points[i];
    const float distance = p.norm();
    if (all.normals[i].dot(-p) < MIN_FACING * distance) continue;
    const float slope = all.normals[i].dot(-p) / distance;
    const float gap = static_cast<float>(OCCLUSION_GAP + OCCLUSION_CELL * (1 / slope - 1));
    if (distance > nearest[cellOf(p)] + gap) continue;
    facing.points.push_back(p);
    facing.normals.push_back(all.normals[i]);
  }
  return facing;
}

enum class Sight { SEEN, HIDDEN, VIOLATED };

/// What the camera saw where a point of the model should be. The table where the model should be is
/// neither: it lies within tolerance of every model's foot.
Sight sightOf(const Eigen::Vector3f& p, const Eigen::Vector3f& normal, const Cloud& scene,
              const Projection& projection, const std::optional<Table>& table, double tolerance) {
  if (p.z() * projection.forward <= 0) return Sight::HIDDEN;
  const Eigen::Vector2d pixel = projection.pixel(p.cast<double>());
  const int u = static_cast<int>(std::lround(pixel.x())),
            v = static_cast<int>(std::lround(pixel.y()));
  if (u < 0 || v < 0 || u >= scene.width || v >= scene.height) return Sight::HIDDEN;
  const std::size_t i = static_cast<std::size_t>(v) * scene.width + u;
  if (!scene.valid(i)) return Sight::HIDDEN;

  const float range = p.norm();
  const double facing = normal.dot(-p) / range;
  const double slack = 1.5 * tolerance / std::max(0.3, facing);
  const double behind = scene.point(i).norm() - range;
  if (behind > slack) return Sight::VIOLATED;
  const bool table_seen = table && heightAbove(*table, scene.point(i)) < tolerance;
  return behind < -slack || table_seen ? Sight::HIDDEN : Sight::SEEN;
}

void explainCluster(const ObjectModel& model, const NearestGrid& grid,
                    const Eigen::Isometry3d& T_camera_object, const Surface& cluster,
                    double tolerance, Verification& verification) {
  const Eigen::Isometry3f T = T_camera_object.inverse().cast<float>();
  const auto limit = static_cast<float>(tolerance * tolerance);
  int explained = 0;
  double sum = 0;
  for (std::size_t i = 0; i < cluster.size(); ++i) {
    const Eigen::Vector3f p = T * cluster.points[i];
    const int nearest = grid.nearest(p);
    if (nearest < 0) continue;
    const float squared = (model.surface.points[nearest] - p).squaredNorm();
    const Eigen::Vector3f normal = T.linear() * cluster.normals[i];
    const float agreement = std::abs(normal.dot(model.surface.normals[nearest]));
    if (squared > limit || agreement < MIN_NORMAL_DOT) continue;
    ++explained;
    sum += squared;
  }
  if (explained == 0) return;
  verification.explained = static_cast<double>(explained) / static_cast<double>(cluster.size());
  verification.fitness = std::sqrt(sum / explained);
}

void lookForModel(const Surface& facing, const Surface& cluster, const Cloud& scene,
                  const std::optional<Projection>& projection, const std::optional<Table>& table,
                  double tolerance, Verification& verification) {
  if (facing.empty()) return;
  const KdTree tree(projection ? std::vector<Eigen::Vector3f>() : cluster.points);
  int seen = 0, violated = 0;
  for (std::size_t i = 0; i < facing.size(); ++i) {
    if (projection) {
      const Sight sight =
          sightOf(facing.points[i], facing.normals[i], scene, *projection, table, tolerance);
      seen += sight == Sight::SEEN;
      violated += sight == Sight::VIOLATED;
    } else {
      const auto nearest = tree.nearest(facing.points[i]);
      seen += nearest.index >= 0 && nearest.squared_distance <= tolerance * tolerance;
    }
  }
  const auto all = static_cast<double>(facing.size());
  verification.visible = seen / all;
  verification.violation = violated / all;
  verification.hidden = 1 - verification.visible - verification.violation;
}

/// How deep a model reaches below the table's surface [m].
double sinkOf(const Surface& model, const Eigen::Isometry3d& T_camera_object, const Table& table) {
  const Eigen::Isometry3f T = T_camera_object.cast<float>();
  double lowest = 0;
  for (const auto& p : model.points) lowest = std::min(lowest, heightAbove(table, T * p));
  return -lowest;
}

std::string refusal(const Verification& v, const VerifyOptions& options) {
  char text[120];
  if (v.explained < options.min_explained)
    std::snprintf(text, sizeof text, "the model explains %.2f of the cluster, limit %.2f",
                  v.explained, options.min_explained);
  else if (v.violation > options.max_violation)
    std::snprintf(text, sizeof text,
                  "%.2f of the model is where the camera saw through, limit %.2f", v.violation,
                  options.max_violation);
  else if (v.visible < options.min_visible)
    std::snprintf(text, sizeof text, "%.2f of the model's surface was seen, limit %.2f", v.visible,
                  options.min_visible);
  else if (v.sink > options.max_sink)
    std::snprintf(text, sizeof text, "the model reaches %.3f m into the table, limit %.3f", v.sink,
                  options.max_sink);
  else if (v.score < options.min_score)
    std::snprintf(text, sizeof text, "score %.2f, limit %.2f", v.score, options.min_score);
  else
    return "";
  return text;
}

}  // namespace

Verification verifyPose(const ObjectModel& model, const NearestGrid& grid,
                        const Eigen::Isometry3d& T_camera_object, const Surface& cluster,
                        const Cloud& scene, const std::optional<Projection>& projection,
                        const std::optional<Table>& table, const VerifyOptions& options) {
  checkOptions("verify", options);
  Verification verification;
  explainCluster(model, grid, T_camera_object, cluster, options.tolerance, verification);
  const Surface facing = facingSurface(model.surface, T_camera_object);
  lookForModel(facing, cluster, scene, projection, table, options.tolerance, verification);
  if (table) verification.sink = sinkOf(model.surface, T_camera_object, *table);

  const double seen = verification.visible + verification.violation;
  const double consistent = seen > 0 ? verification.visible / seen : 0;
  const double misfit = verification.fitness / options.tolerance;
  verification.score = verification.explained * consistent * std::exp(-misfit * misfit);
  verification.reason = refusal(verification, options);
  return verification;
}

}  // namespace tabletop_perception
