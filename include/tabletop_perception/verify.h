#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/agreement.h"
#include "tabletop_perception/options.h"

namespace tabletop_perception {

struct VerifyOptions {
  double tolerance = 0.008;     ///< farthest a scene point lies from the model it belongs to [m]
  double min_score = 0.5;       ///< objects less probable than this are unknown
  double min_agreement = 0.4;   ///< least agreement with what the camera saw
  double min_margin = 0.02;     ///< least lead in agreement over the best other object
  double min_explained = 0.7;   ///< least share of the cluster that the model explains
  double min_visible = 0.3;     ///< least share of the model's surface that the camera saw
  double max_sink = 0.02;       ///< deepest that a model may reach into the table [m]
  double max_violation = 0.25;  ///< largest share of the model that hides what the camera saw
  bool color = true;            ///< colours count where both model and scene have them

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("tolerance", tolerance, Range{0.001, 0.1});
    visit("min_score", min_score, Range{0, 1});
    visit("min_agreement", min_agreement, Range{0, 1});
    visit("min_margin", min_margin, Range{0, 1});
    visit("min_explained", min_explained, Range{0, 1});
    visit("min_visible", min_visible, Range{0, 1});
    visit("max_sink", max_sink, Range{0, 1});
    visit("max_violation", max_violation, Range{0, 1});
    visit("color", color);
  }
};

/// What the camera says about a pose.
struct Verification {
  Agreement agreement;  ///< with the parts that the model touches, and with the whole picture
  double sink = 0;      ///< how deep the model reaches into the table, 0 without a table [m]
  double score = 0;     ///< of the agreement, 0 to 1
  std::string reason;   ///< why the pose is refused; empty if it is accepted
};

/// Holds a pose against the scene and the table. `parts`: sampled points of the clusters that may
/// show the object, by smooth parts, in the camera's frame. Parts that the model hardly touches
/// belong to something else and do not count. Colours are compared where the shape alone does not
/// refuse the pose. `model`: index into those of `index`.
Verification verifyPose(const ModelIndex& index, int model,
                        const Eigen::Isometry3d& T_camera_object,
                        const std::vector<PlanarSurface>& parts, const Observation& observation,
                        const VerifyOptions& options);

/// What speaks for and against an object of a scene.
struct Evidence {
  Agreement agreement;  ///< of its pose
  double rms = 0;       ///< distance of all points about it from the model's tangent planes [m]
  double area = 0;      ///< of the surface that it explains [m^2]
  double margin = 1;    ///< lead of its agreement over that of the best other object there
  double lift = 0;      ///< of its lowest point above the table; 0 without a table and where
                        ///< something else carries it [m]
  double turn = 1;      ///< probability of its turn among those that look nearly alike
};

/// The terms of the log odds that an object is what it is taken for, and their names: the evidence
/// as a logistic regression weighs it.
Eigen::VectorXd scoreTerms(const Evidence& evidence);
std::vector<std::string> scoreTermNames();

/// Estimate of the probability that an object has the name and the pose it is given.
double probabilityOf(const Evidence& evidence);

}  // namespace tabletop_perception
