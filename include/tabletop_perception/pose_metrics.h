#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/mesh.h"

namespace tabletop_perception {

/// An object's shape as poses are measured with.
struct ReferenceModel {
  KdTree vertices;      ///< of the mesh, all of them [m]
  double diameter = 0;  ///< largest distance of two vertices [m]
  /// Motions of the object's frame that change nothing, the identity first.
  std::vector<Eigen::Isometry3d> symmetries;
};

/// A mesh and its symmetry in words: "none", "axis z (continuous)", "half z" (a half turn; x, y and
/// z in both), "box 180deg" (half turns about the directions of its sides: real models lie askew in
/// their frames), about the middle of the vertices' bounding box. Any other words, and none at all,
/// have the symmetry detected in the shape. A continuous axis counts in turns of one degree.
ReferenceModel makeReferenceModel(const Mesh& mesh, const std::string& symmetry);

/// How far a pose is from the truth [m].
struct PoseError {
  /// Maximum symmetry-aware surface distance: the largest displacement of a vertex, smallest over
  /// the symmetries (Hodan et al., BOP Challenge 2020).
  double mssd = 0;
  /// Mean distance of the truth's vertices to the nearest vertex of the estimate (Hinterstoisser et
  /// al. 2012, for objects without a definite pose).
  double add_s = 0;
  /// Distance of the object frame's origins, the truth moved by the symmetry that gave `mssd`.
  double translation = 0;
  std::optional<double> rotation;  ///< between the frames, of an object without symmetry [rad]
};

PoseError measurePose(const ReferenceModel& model, const Eigen::Isometry3d& T_camera_truth,
                      const Eigen::Isometry3d& T_camera_estimate);

/// An object with its place in a scene.
struct PosedObject {
  std::string name;
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
};

/// How an object of the truth came out.
struct PoseOutcome {
  std::string name;
  double diameter = 0;             ///< of its model [m]
  std::optional<PoseError> error;  ///< of the result it was given; without one it was not named
  bool by_add_s = false;           ///< the camera cannot tell its pose: ADD-S decides

  bool close() const { return error && error->add_s < 0.1 * diameter; }
  bool right() const { return by_add_s ? close() : error && error->mssd < 0.1 * diameter; }
};

/// How a scene came out.
struct PoseScore {
  std::vector<PoseOutcome> truth;              ///< in the order of the truth
  std::map<std::string, std::size_t> results;  ///< number of results under each name
  /// The object that each result was given to, in the order of the results.
  std::vector<std::optional<std::size_t>> object_of_result;
};

/// Gives results to objects of the same name, one to one, the pair with the lowest MSSD first.
/// `results` are those that carry a name, without the unknown. Throws std::invalid_argument for an
/// object of the truth that has no model.
PoseScore scorePoses(const std::vector<PosedObject>& truth, const std::vector<PosedObject>& results,
                     const std::map<std::string, ReferenceModel>& models);

/// Figures over the objects of several scenes, in one pool.
struct PoseSummary {
  std::size_t objects = 0;  ///< in the truth
  std::size_t results = 0;  ///< that carry a name
  std::size_t named = 0;    ///< objects that were given a result of their name
  std::size_t right = 0;    ///< objects whose result has an MSSD under 0.1 diameters
  std::size_t close = 0;    ///< objects whose result has an ADD-S under 0.1 diameters
  /// Area under the curve of the share of objects with an ADD-S below a threshold, for thresholds
  /// from 0 to 10 cm, as a share of the full area: the mean of max(0, 1 - ADD-S / 10 cm). None
  /// without objects.
  std::optional<double> add_s_auc;
  std::optional<double> median_translation;  ///< of the right ones, if there are any [m]
  std::optional<double> median_add_s;        ///< likewise [m]
  std::optional<double> median_rotation;     ///< likewise, of those without symmetry [rad]

  /// right, close and named / objects; none without objects.
  std::optional<double> rightShare() const;
  std::optional<double> closeShare() const;
  std::optional<double> namedShare() const;
  /// right / results; none without results.
  std::optional<double> precision() const;
};

PoseSummary summarize(const std::vector<PoseScore>& scores);

/// The same scenes with the objects and results of one name only.
std::vector<PoseScore> ofName(const std::vector<PoseScore>& scores, const std::string& name);

/// All names in the truth and the results.
std::set<std::string> namesIn(const std::vector<PoseScore>& scores);

}  // namespace tabletop_perception
