#pragma once

#include <optional>
#include <string>

#include <Eigen/Geometry>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/model.h"
#include "tabletop_perception/nearest_grid.h"
#include "tabletop_perception/options.h"
#include "tabletop_perception/projection.h"
#include "tabletop_perception/table.h"

namespace tabletop_perception {

struct VerifyOptions {
  double tolerance = 0.008;     ///< farthest a scene point lies from the model it belongs to [m]
  double min_score = 0.7;       ///< lower scores are unknown objects
  double min_margin = 0.02;     ///< least lead in score over the best other object
  double min_explained = 0.7;   ///< least share of the cluster that the model explains
  double min_visible = 0.15;    ///< least share of the model's surface that the camera saw
  double max_sink = 0.02;       ///< deepest that a model may reach into the table [m]
  double max_violation = 0.25;  ///< largest share of the model that hides what the camera saw

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("tolerance", tolerance, Range{0.001, 0.1});
    visit("min_score", min_score, Range{0, 1});
    visit("min_margin", min_margin, Range{0, 1});
    visit("min_explained", min_explained, Range{0, 1});
    visit("min_visible", min_visible, Range{0, 1});
    visit("max_sink", max_sink, Range{0, 1});
    visit("max_violation", max_violation, Range{0, 1});
  }
};

/// What the camera says about a pose.
struct Verification {
  double explained = 0;  ///< share of the cluster's points within tolerance of the model
  double visible = 0;    ///< share of the model's surface facing the camera that the camera saw
  double hidden = 0;     ///< share of it that something nearer hides, or that has no depth
  double violation = 0;  ///< share of it through which the camera saw something behind
  double sink = 0;       ///< how deep the model reaches into the table, 0 without a table [m]
  double fitness = 0;    ///< RMS distance of the explained points from the model [m]
  double score = 0;      ///< estimate of the probability of being right, 0 to 1
  std::string reason;    ///< why the pose is refused; empty if it is accepted
};

/// Holds a pose against the scene and the table. Without a projection, free space is left out of
/// it and `visible` comes from the cluster alone.
Verification verifyPose(const ObjectModel& model, const NearestGrid& grid,
                        const Eigen::Isometry3d& T_camera_object, const Surface& cluster,
                        const Cloud& scene, const std::optional<Projection>& projection,
                        const std::optional<Table>& table, const VerifyOptions& options);

}  // namespace tabletop_perception
