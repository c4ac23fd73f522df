#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/planar_surface.h"
#include "tabletop_perception/projection.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

/// What the camera saw at a pixel.
struct SeenPoint {
  float range;   ///< of the point there, NaN for none [m]
  float height;  ///< of it above the table, infinite without one [m]
};

/// What the camera saw, made ready to hold poses against it. Refers to the scene and the table that
/// it was made of: they must outlive it.
struct Observation {
  const Cloud& scene;
  const Table* table = nullptr;                             ///< none: nothing is known of one
  std::optional<Projection> projection;                     ///< none: free space says nothing
  std::shared_ptr<const std::vector<SeenPoint>> sightings;  ///< per pixel, where it is known
  std::shared_ptr<const KdTree> points;          ///< of the scene, where there is no projection
  std::shared_ptr<const Indices> point_indices;  ///< of these points in the scene
  bool colored = false;  ///< whether the scene has colours to compare, and not greys alone
};

Observation observe(const Cloud& scene, const std::optional<Table>& table);

/// With a projection that is known, or none. `table`: null for none.
Observation observe(const Cloud& scene, const Table* table,
                    const std::optional<Projection>& projection);

/// A scene of several tables: an observation with each of them, or a single one without any. Refers
/// to the scene and the tables, which must outlive it.
class Observations {
 public:
  /// `tables`: the main one first.
  Observations(const Cloud& scene, const std::vector<Table>& tables);

  /// With the table that a thing about `middle` stands on.
  const Observation& about(const Eigen::Vector3f& middle) const;

 private:
  const std::vector<Table>& tables_;
  std::vector<Observation> observations_;
};

/// How a model at a pose agrees with some points and with the whole picture.
struct Agreement {
  double explained = 0;  ///< share of the points within tolerance of the model
  double fitness = 0;    ///< RMS distance of the explained points from the model [m]
  double visible = 0;    ///< share of the model's surface facing the camera that the camera saw
  double hidden = 0;     ///< share of it that something nearer hides, or that has no depth
  double violation = 0;  ///< share of it through which the camera saw something behind
  std::optional<double> color;  ///< likeness of the colours, where they were compared, 0 to 1

  /// explained * visible / (visible + violation) * exp(-(fitness / tolerance)^2) of the shape,
  /// times what the colours leave of it: 0 to 1.
  double score(double tolerance) const;
  double shapeScore(double tolerance) const;  ///< of the shape alone
};

/// `points`: in the camera's frame, with normals. `model`: index into those of `index`.
Agreement agreementOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                      const PlanarSurface& points, const Observation& observation,
                      double tolerance);

/// Share of the points within `tolerance` of the model that face as it does.
double explainedShare(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                      const PlanarSurface& points, double tolerance);

/// Mean over the points of 1 - (distance / tolerance)^2, 0 for those that the model does not
/// explain: 0 to 1.
double closenessOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                   const PlanarSurface& points, double tolerance);

/// For each of the points, whether it lies within `tolerance` of the model and faces as it does: a
/// bit of a word for each block, the lowest first.
std::vector<std::uint32_t> explainedPoints(const ModelIndex& index, int model,
                                           const Eigen::Isometry3d& T_camera_object,
                                           const PlanarSurface& points, double tolerance);

}  // namespace tabletop_perception
