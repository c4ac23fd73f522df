#include "tabletop_perception/pose_metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <regex>
#include <stdexcept>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/symmetry.h"

namespace tabletop_perception {
namespace {

constexpr double AUC_LIMIT = 0.1;         // [m]
constexpr int STEPS_OF_A_TURN = 360;      // of a continuous symmetry
constexpr int SAMPLES_OF_SURFACE = 4000;  // for the detection of symmetries

std::optional<double> share(std::size_t part, std::size_t all) {
  if (all == 0) return std::nullopt;
  return static_cast<double>(part) / all;
}

/// Points spread evenly over the faces by area, with the faces' normals: the vertices of a mesh may
/// be anywhere. Always the same ones for the same mesh.
Surface sampledSurface(const Mesh& mesh) {
  std::vector<double> area_up_to;
  double area = 0;
  for (const auto& face : mesh.faces) {
    const Eigen::Vector3f a = mesh.vertices[face[0]];
    area += (mesh.vertices[face[1]] - a).cross(mesh.vertices[face[2]] - a).norm() / 2;
    area_up_to.push_back(area);
  }

  Surface surface;
  std::size_t f = 0;
  for (int i = 0; i < SAMPLES_OF_SURFACE; ++i) {
    while (f + 1 < area_up_to.size() && area_up_to[f] < area * (i + 0.5) / SAMPLES_OF_SURFACE) ++f;
    const auto& face = mesh.faces[f];
    const Eigen::Vector3f a = mesh.vertices[face[0]];
    const Eigen::Vector3f ab = mesh.vertices[face[1]] - a, ac = mesh.vertices[face[2]] - a;
    // The R2 sequence (Roberts 2018) fills the unit square evenly; one half folds onto the other.
    double u = std::fmod(0.5 + i * 0.7548776662466927, 1.0);
    double v = std::fmod(0.5 + i * 0.5698402909980532, 1.0);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    surface.points.push_back(a + static_cast<float>(u) * ab + static_cast<float>(v) * ac);
    surface.normals.push_back(ab.cross(ac).normalized());
  }
  return surface;
}

Eigen::Vector3d middleOf(const std::vector<Eigen::Vector3f>& points) {
  Eigen::AlignedBox3f box;
  for (const auto& p : points) box.extend(p);
  return box.center().cast<double>();
}

Symmetry symmetryOf(const Mesh& mesh, const std::string& words) {
  static const std::regex DECLARED(R"((none|axis [xyz]|half [xyz]|box)( \(continuous\)| 180deg)?)");
  std::smatch match;
  const Surface surface = sampledSurface(mesh);
  if (!std::regex_match(words, match, DECLARED)) return detectSymmetry(surface);
  Symmetry symmetry = declaredSymmetry(match[1], middleOf(mesh.vertices));
  if (match[1] == "box") {
    const Eigen::Matrix3d axes = dominantAxes(surface);
    for (auto& rotation : symmetry.rotations) rotation = axes * rotation * axes.transpose();
  }
  return symmetry;
}

/// The largest distance that a vertex has under two motions.
double largestDisplacement(const std::vector<Eigen::Vector3f>& vertices, const Eigen::Isometry3d& a,
                           const Eigen::Isometry3d& b) {
  const Eigen::Matrix3d linear = a.linear() - b.linear();
  const Eigen::Vector3d shift = a.translation() - b.translation();
  double largest = 0;
  for (const auto& vertex : vertices)
    largest = std::max(largest, (linear * vertex.cast<double>() + shift).squaredNorm());
  return std::sqrt(largest);
}

double meanNearestDistance(const KdTree& vertices, const Eigen::Isometry3d& T_estimate_truth) {
  double sum = 0;
  for (const auto& vertex : vertices.points()) {
    const Eigen::Vector3d moved = T_estimate_truth * vertex.cast<double>();
    sum += std::sqrt(vertices.nearest(moved.cast<float>()).squared_distance);
  }
  return sum / vertices.points().size();
}

std::optional<double> medianOf(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  if (values.size() % 2 == 1) return values[middle];
  return (values[middle - 1] + values[middle]) / 2;
}

}  // namespace

ReferenceModel makeReferenceModel(const Mesh& mesh, const std::string& symmetry) {
  const double diameter = diameterOf(mesh.vertices);
  return {KdTree(mesh.vertices), diameter,
          symmetryMotions(symmetryOf(mesh, symmetry), STEPS_OF_A_TURN)};
}

PoseError measurePose(const ReferenceModel& model, const Eigen::Isometry3d& T_camera_truth,
                      const Eigen::Isometry3d& T_camera_estimate) {
  PoseError error;
  error.mssd = std::numeric_limits<double>::infinity();
  for (const auto& symmetry : model.symmetries) {
    const Eigen::Isometry3d T_camera_same = T_camera_truth * symmetry;
    const double displacement =
        largestDisplacement(model.vertices.points(), T_camera_same, T_camera_estimate);
    if (displacement >= error.mssd) continue;
    error.mssd = displacement;
    error.translation = (T_camera_same.translation() - T_camera_estimate.translation()).norm();
  }
  if (model.symmetries.size() == 1)
    error.rotation = angleOf(T_camera_truth.linear().transpose() * T_camera_estimate.linear());
  error.add_s = meanNearestDistance(model.vertices, T_camera_estimate.inverse() * T_camera_truth);
  return error;
}

PoseScore scorePoses(const std::vector<PosedObject>& truth, const std::vector<PosedObject>& results,
                     const std::map<std::string, ReferenceModel>& models) {
  struct Pair {
    std::size_t object, result;
    PoseError error;
  };
  PoseScore score;
  std::vector<Pair> pairs;
  for (std::size_t t = 0; t < truth.size(); ++t) {
    const auto model = models.find(truth[t].name);
    if (model == models.end())
      throw std::invalid_argument("no model of the truth's object '" + truth[t].name + "'");
    score.truth.push_back({truth[t].name, model->second.diameter, std::nullopt, false});
    for (std::size_t r = 0; r < results.size(); ++r)
      if (results[r].name == truth[t].name)
        pairs.push_back(
            {t, r,
             measurePose(model->second, truth[t].T_camera_object, results[r].T_camera_object)});
  }
  for (const auto& result : results) ++score.results[result.name];

  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.error.mssd < b.error.mssd; });
  score.object_of_result.resize(results.size());
  for (const auto& pair : pairs) {
    auto& outcome = score.truth[pair.object];
    auto& object = score.object_of_result[pair.result];
    if (outcome.error || object) continue;
    outcome.error = pair.error;
    object = pair.object;
  }
  return score;
}

std::optional<double> PoseSummary::rightShare() const { return share(right, objects); }
std::optional<double> PoseSummary::closeShare() const { return share(close, objects); }
std::optional<double> PoseSummary::namedShare() const { return share(named, objects); }
std::optional<double> PoseSummary::precision() const { return share(right, results); }

PoseSummary summarize(const std::vector<PoseScore>& scores) {
  PoseSummary summary;
  std::vector<double> translations, distances, rotations;
  double area = 0;
  for (const auto& score : scores) {
    for (const auto& [name, count] : score.results) summary.results += count;
    for (const auto& outcome : score.truth) {
      ++summary.objects;
      if (!outcome.error) continue;
      ++summary.named;
      summary.right += outcome.right();
      summary.close += outcome.close();
      area += std::max(0.0, 1 - outcome.error->add_s / AUC_LIMIT);
      if (!outcome.right()) continue;
      translations.push_back(outcome.error->translation);
      distances.push_back(outcome.error->add_s);
      if (outcome.error->rotation) rotations.push_back(*outcome.error->rotation);
    }
  }
  if (summary.objects > 0) summary.add_s_auc = area / summary.objects;
  summary.median_translation = medianOf(translations);
  summary.median_add_s = medianOf(distances);
  summary.median_rotation = medianOf(rotations);
  return summary;
}

std::vector<PoseScore> ofName(const std::vector<PoseScore>& scores, const std::string& name) {
  std::vector<PoseScore> chosen;
  for (const auto& score : scores) {
    PoseScore& part = chosen.emplace_back();
    for (const auto& outcome : score.truth)
      if (outcome.name == name) part.truth.push_back(outcome);
    const auto results = score.results.find(name);
    if (results != score.results.end()) part.results.insert(*results);
  }
  return chosen;
}

std::set<std::string> namesIn(const std::vector<PoseScore>& scores) {
  std::set<std::string> names;
  for (const auto& score : scores) {
    for (const auto& outcome : score.truth) names.insert(outcome.name);
    for (const auto& [name, count] : score.results) names.insert(name);
  }
  return names;
}

}  // namespace tabletop_perception
