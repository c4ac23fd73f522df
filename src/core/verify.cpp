#include "tabletop_perception/verify.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "lowest_point.h"
#include "tabletop_perception/logistic.h"
#include "tabletop_perception/surface_color.h"

namespace tabletop_perception {
namespace {

// Of the terms of the score. `tabletop evaluate --fit` prints what they should be for given scenes;
// docs/evaluation.md says which of them are in use and why.
constexpr int TERMS = 10;
constexpr double WEIGHTS[TERMS] = {6.6, 8.8, 16.6, 0, -0.81, 0, 0, 0, -19.7, 5};
constexpr double LEAST_SHARE = 0.01;   // smaller ones are as unlikely
constexpr double LEAST_AREA = 1e-4;    // [m^2]
constexpr double TABLE_ERROR = 0.012;  // of the table's height where a thing stands [m]

constexpr double LEAST_LIKENESS = 0.05;  // of colours; less is as unlikely
constexpr double FULL_LIKENESS = 0.5;    // more is as likely

constexpr std::size_t MAX_COLORED = 300;  // points whose colours are compared
constexpr double MIN_TOUCHED = 0.2;  // share of a part that a model explains if it shows the model

double square(double x) { return x * x; }

/// How far off the table's height a thing is, from as far as a table of a real camera may be off: 0
/// to 1.
double offTable(double lift) {
  return std::clamp((std::abs(lift) - TABLE_ERROR) / TABLE_ERROR, 0.0, 1.0);
}

/// How far colours are from as alike as a camera shows those of the same thing: 0, or less.
double unlike(double color) {
  return std::log(std::clamp(color, LEAST_LIKENESS, FULL_LIKENESS) / FULL_LIKENESS);
}

/// The parts that a model touches; all of them if it touches none.
PlanarSurface touchedParts(const ModelIndex& index, int model,
                           const Eigen::Isometry3d& T_camera_object,
                           const std::vector<PlanarSurface>& parts, double tolerance) {
  PlanarSurface touched;
  for (const auto& part : parts)
    if (explainedShare(index, model, T_camera_object, part, tolerance) >= MIN_TOUCHED)
      touched.append(part);
  if (touched.size == 0)
    for (const auto& part : parts) touched.append(part);
  return touched;
}

std::vector<Eigen::Vector3f> pointsOf(const PlanarSurface& surface) {
  std::vector<Eigen::Vector3f> points;
  points.reserve(surface.size);
  for (const auto& block : surface.blocks)
    for (int i = 0; i < PlanarBlock::SIZE; ++i)
      if (!std::isnan(block.x[i])) points.emplace_back(block.x[i], block.y[i], block.z[i]);
  return points;
}

std::string refusal(const Verification& verification, const VerifyOptions& options) {
  const Agreement& v = verification.agreement;
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
  else if (verification.sink > options.max_sink)
    std::snprintf(text, sizeof text, "the model reaches %.3f m into the table, limit %.3f",
                  verification.sink, options.max_sink);
  else if (verification.score < options.min_agreement)
    std::snprintf(text, sizeof text, "agreement %.2f, limit %.2f", verification.score,
                  options.min_agreement);
  else
    return "";
  return text;
}

}  // namespace

Verification verifyPose(const ModelIndex& index, int model,
                        const Eigen::Isometry3d& T_camera_object,
                        const std::vector<PlanarSurface>& parts, const Observation& observation,
                        const VerifyOptions& options) {
  checkOptions("verify", options);
  const PlanarSurface touched =
      touchedParts(index, model, T_camera_object, parts, options.tolerance);
  Verification verification;
  verification.agreement =
      agreementOf(index, model, T_camera_object, touched, observation, options.tolerance);
  if (observation.table)
    verification.sink =
        sinkOf(*observation.table, T_camera_object, index.sparse(model).surface.points);
  const auto judge = [&] {
    verification.score = verification.agreement.score(options.tolerance);
    verification.reason = refusal(verification, options);
  };
  judge();
  if (!verification.reason.empty() || !options.color || index.colors(model).empty())
    return verification;
  verification.agreement.color = bestColorLikeness(
      index, model, T_camera_object, coloredPoints(observation, pointsOf(touched), MAX_COLORED),
      options.tolerance);
  judge();
  return verification;
}

Eigen::VectorXd scoreTerms(const Evidence& evidence) {
  const Agreement& agreement = evidence.agreement;
  const double seen = agreement.visible + agreement.violation;
  const double not_seen_through = seen > 0 ? agreement.visible / seen : 0;
  const auto logOf = [](double share) { return std::log(std::max(LEAST_SHARE, share)); };
  Eigen::VectorXd terms(TERMS);
  terms << 1, logOf(agreement.explained), logOf(not_seen_through), logOf(agreement.visible),
      square(1000 * evidence.rms), square(1000 * agreement.fitness),
      std::log(std::max(LEAST_AREA, evidence.area) / LEAST_AREA), logOf(evidence.margin),
      offTable(evidence.lift), agreement.color ? unlike(*agreement.color) : 0;
  return terms;
}

std::vector<std::string> scoreTermNames() {
  return {"constant", "explained", "not seen through", "visible", "rms",
          "fitness",  "area",      "margin",           "lift",    "color"};
}

double probabilityOf(const Evidence& evidence) {
  const Eigen::Map<const Eigen::VectorXd> weights(WEIGHTS, TERMS);
  return evidence.turn * logistic(weights.dot(scoreTerms(evidence)));
}

}  // namespace tabletop_perception
