#include "cut_by_model.h"

#include <algorithm>
#include <iterator>

#include "near_model.h"
#include "stands_at_point.h"
#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/normals.h"

namespace tabletop_perception {
namespace {

constexpr int MOST_STANDS = 15;        // that are tried
constexpr float MODEL_REACH = 0.012f;  // of points that ICP moves a model onto, at first [m]
constexpr double ALIGNED = 0.006;      // and in the end [m]
constexpr int ITERATIONS = 15;         // of ICP
constexpr float CUT = 0.01f;           // from a model to what it cuts out [m]
constexpr float NEIGHBOR = 0.015f;     // of a point of a cut beyond it [m]
constexpr float CONCAVE = -0.1f;       // sine of the bend of a surface between two points, about
constexpr double MAX_BEYOND = 0.16;    // of points beyond a cut on the same surface, to those in it

/// Some points of a surface and the others.
struct Division {
  Surface in, out;
};

/// By the distance from a model at a pose.
Division divided(const Surface& surface, const ModelIndex& index, int model,
                 const Eigen::Isometry3d& T_camera_object, float reach) {
  const Eigen::Isometry3f T_object_camera = T_camera_object.inverse().cast<float>();
  Division division;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const float squared = squaredDistance(index, model, T_object_camera, surface.points[i]);
    Surface& part = squared < reach * reach ? division.in : division.out;
    part.points.push_back(surface.points[i]);
    part.normals.push_back(surface.normals[i]);
  }
  return division;
}

/// The share of points beyond a cut that continue its surface, flat or over an edge that is not
/// hollow (Stein et al. 2014), to those in it.
double beyond(const Division& division) {
  if (division.in.empty()) return 0;
  const KdTree tree(division.in.points);
  int continuing = 0;
  for (std::size_t j = 0; j < division.out.size(); ++j) {
    const auto nearest = tree.nearest(division.out.points[j]);
    if (!(nearest.squared_distance < NEIGHBOR * NEIGHBOR)) continue;
    const Eigen::Vector3f between =
        (division.out.points[j] - division.in.points[nearest.index]).normalized();
    const Eigen::Vector3f bend = division.out.normals[j] - division.in.normals[nearest.index];
    continuing += bend.dot(between) > CONCAVE;
  }
  return continuing / static_cast<double>(division.in.size());
}

}  // namespace

std::vector<ModelCut> cutsByModels(const Observation& observation, const Indices& standing,
                                   const Eigen::Vector3f& point, const ModelIndex& index,
                                   const RefineOptions& refine) {
  const auto& description = index.descriptorOptions();
  const Surface samples = sampleSurface(pointsAt(observation.scene, standing), description.leaf,
                                        description.normal_radius, Eigen::Vector3f::Zero());
  if (samples.empty()) return {};
  const Eigen::Vector3f normal = samples.normals[KdTree(samples.points).nearest(point).index];
  RefineOptions coarse = refine;
  coarse.max_iterations = ITERATIONS;
  coarse.start_distance = MODEL_REACH;
  coarse.max_distance = ALIGNED;
  coarse.min_overlap = 0;
  std::vector<ModelCut> cuts;
  for (const auto& candidate : standsAt(point, normal, observation, index, MOST_STANDS)) {
    const int model = index.find(candidate.name);
    Eigen::Isometry3d pose = candidate.T_camera_object;
    const Surface near = divided(samples, index, model, pose, MODEL_REACH).in;
    const auto alignment = refinePose(near, index.grid(model), pose, coarse);
    if (alignment) pose = alignment->T_camera_object;
    if (beyond(divided(samples, index, model, pose, CUT)) > MAX_BEYOND) continue;
    ModelCut cut{candidate.name, {}};
    const Eigen::Isometry3f T_object_camera = pose.inverse().cast<float>();
    std::copy_if(standing.begin(), standing.end(), std::back_inserter(cut.points), [&](int i) {
      return squaredDistance(index, model, T_object_camera, observation.scene.point(i)) < CUT * CUT;
    });
    if (!cut.points.empty()) cuts.push_back(std::move(cut));
  }
  return cuts;
}

}  // namespace tabletop_perception
