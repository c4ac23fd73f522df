#include "tabletop_perception/agreement.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tabletop_perception {
namespace {

constexpr float MIN_NORMAL_DOT = 0.5f;  // of model and scene, either side of a thin wall
constexpr double MIN_FACING = 0.3;   // cosine to the line of sight; flatter surfaces count as this
constexpr double DEPTH_SLACK = 1.5;  // of what is seen at an angle, in tolerances

/// Holds points against a model at a pose: squared distance of each, or none.
class Explainer {
 public:
  Explainer(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
            double tolerance)
      : surface_(index.models()[model].surface),
        grid_(index.grid(model)),
        T_object_camera_(T_camera_object.inverse().cast<float>()),
        limit_(static_cast<float>(tolerance * tolerance)) {}

  /// Squared distance [m^2]; -1 for a point that the model does not explain.
  float operator()(const Eigen::Vector3f& point, const Eigen::Vector3f& normal) const {
    const Eigen::Vector3f p = T_object_camera_ * point;
    const int nearest = grid_.nearest(p);
    if (nearest < 0) return -1;
    const float squared = (surface_.points[nearest] - p).squaredNorm();
    if (squared > limit_) return -1;
    const Eigen::Vector3f n = T_object_camera_.linear() * normal;
    return std::abs(n.dot(surface_.normals[nearest])) < MIN_NORMAL_DOT ? -1 : squared;
  }

 private:
  const Surface& surface_;
  const NearestGrid& grid_;
  Eigen::Isometry3f T_object_camera_;
  float limit_;
};

enum class Sight { SEEN, HIDDEN, VIOLATED };

/// What the camera saw where a point of the model should be. The table where the model should be is
/// neither: it lies within tolerance of every model's foot.
Sight sightOf(const Eigen::Vector3f& p, const Eigen::Vector3f& normal,
              const Observation& observation, double tolerance) {
  const Cloud& scene = observation.scene;
  const Projection& projection = *observation.projection;
  if (p.z() * projection.forward <= 0) return Sight::HIDDEN;
  const Eigen::Vector2d pixel = projection.pixel(p.cast<double>());
  const int u = static_cast<int>(std::lround(pixel.x())),
            v = static_cast<int>(std::lround(pixel.y()));
  if (u < 0 || v < 0 || u >= scene.width || v >= scene.height) return Sight::HIDDEN;
  const std::size_t i = static_cast<std::size_t>(v) * scene.width + u;
  if (!scene.valid(i)) return Sight::HIDDEN;

  const float range = p.norm();
  const double facing = normal.dot(-p) / range;
  const double slack = DEPTH_SLACK * tolerance / std::max(MIN_FACING, facing);
  const double behind = scene.point(i).norm() - range;
  if (behind > slack) return Sight::VIOLATED;
  const bool table_seen =
      observation.table && heightAbove(*observation.table, scene.point(i)) < tolerance;
  return behind < -slack || table_seen ? Sight::HIDDEN : Sight::SEEN;
}

/// Without a projection only what was seen is known.
Sight sightAmongPoints(const Eigen::Vector3f& p, const KdTree& points, double tolerance) {
  const auto nearest = points.nearest(p);
  const bool seen = nearest.index >= 0 && nearest.squared_distance <= tolerance * tolerance;
  return seen ? Sight::SEEN : Sight::HIDDEN;
}

void lookForModel(const SparseModel& model, const Eigen::Isometry3d& T_camera_object,
                  const Observation& observation, double tolerance, Agreement& agreement) {
  const Eigen::Isometry3f T = T_camera_object.cast<float>();
  const Eigen::Vector3f from_camera = T.linear().transpose() * T.translation();
  const auto& side = model.sideTowards(-from_camera.normalized());
  if (side.visible.empty()) return;
  int seen = 0, violated = 0;
  for (const int i : side.visible) {
    const Eigen::Vector3f p = T * model.surface.points[i];
    const Sight sight =
        observation.projection
            ? sightOf(p, T.linear() * model.surface.normals[i], observation, tolerance)
            : sightAmongPoints(p, *observation.points, tolerance);
    seen += sight == Sight::SEEN;
    violated += sight == Sight::VIOLATED;
  }
  const auto all = static_cast<double>(side.visible.size());
  agreement.visible = seen / all;
  agreement.violation = violated / all;
  agreement.hidden = 1 - agreement.visible - agreement.violation;
}

}  // namespace

Observation observe(const Cloud& scene, const std::optional<Table>& table) {
  Observation observation{scene, table ? &*table : nullptr, fitProjection(scene).value, nullptr};
  if (!observation.projection)
    observation.points = std::make_shared<KdTree>(pointsAt(scene, validIndices(scene)));
  return observation;
}

Observations::Observations(const Cloud& scene, const std::vector<Table>& tables) : tables_(tables) {
  Observation observation = observe(scene, std::nullopt);
  if (tables.empty()) observations_.push_back(observation);
  for (const auto& table : tables) {
    observation.table = &table;
    observations_.push_back(observation);
  }
}

const Observation& Observations::about(const Eigen::Vector3f& middle) const {
  return observations_[tables_.empty() ? 0 : tableUnder(tables_, middle)];
}

double Agreement::score(double tolerance) const {
  const double seen = visible + violation;
  const double misfit = fitness / tolerance;
  return seen > 0 ? explained * visible / seen * std::exp(-misfit * misfit) : 0;
}

Agreement agreementOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                      const Surface& points, const Observation& observation, double tolerance) {
  Agreement agreement;
  const Explainer explainer(index, model, T_camera_object, tolerance);
  int explained = 0;
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float squared = explainer(points.points[i], points.normals[i]);
    if (squared < 0) continue;
    ++explained;
    sum += squared;
  }
  if (explained > 0) {
    agreement.explained = static_cast<double>(explained) / static_cast<double>(points.size());
    agreement.fitness = std::sqrt(sum / explained);
  }
  lookForModel(index.sparse(model), T_camera_object, observation, tolerance, agreement);
  return agreement;
}

double explainedShare(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                      const Surface& points, double tolerance) {
  const Explainer explainer(index, model, T_camera_object, tolerance);
  int explained = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    explained += explainer(points.points[i], points.normals[i]) >= 0;
  return explained / std::max<double>(1, static_cast<double>(points.size()));
}

double closenessOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                   const Surface& points, double tolerance) {
  const Explainer explainer(index, model, T_camera_object, tolerance);
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float squared = explainer(points.points[i], points.normals[i]);
    if (squared >= 0) sum += 1 - squared / (tolerance * tolerance);
  }
  return sum / std::max<double>(1, static_cast<double>(points.size()));
}

std::vector<bool> explainedPoints(const ModelIndex& index, int model,
                                  const Eigen::Isometry3d& T_camera_object, const Surface& points,
                                  double tolerance) {
  const Explainer explainer(index, model, T_camera_object, tolerance);
  std::vector<bool> explained(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    explained[i] = explainer(points.points[i], points.normals[i]) >= 0;
  return explained;
}

}  // namespace tabletop_perception
