#include "settle_turn.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "near_model.h"
#include "tabletop_perception/geometry.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t MAX_TURN_POINTS = 3000;  // that tell near symmetries apart
constexpr double TURN_REACH = 0.015;           // of points about the model that count [m]
constexpr double TURN_DISTANCE = 0.006;        // farther off a point says no more [m]
constexpr double CONTACT_NOISE = 0.001;        // of the table's height under an object [m]
constexpr double MAX_CONTACT_GAP =
    0.004;                             // farther above or below it an object is held otherwise [m]
constexpr double FINEST_RMS = 0.0003;  // of points on a model, for its own sampling [m]
constexpr double MIN_TURN_GAIN = 6;    // least gain in log likelihood that turns an object over

/// How all points about a model lie on it.
struct Fit {
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  double mean_square = 0;   ///< of the points' distances from the model's tangent planes [m^2]
  double correlation = 0;   ///< of neighboring points' distances, 0 to 1
  double contact_cost = 0;  ///< negative log likelihood of its height above the table
};

/// How unlikely it is that a model stands on the table like this: negative log likelihood.
double contactCost(const Surface& model, const Eigen::Isometry3d& T_camera_object,
                   const Table& table) {
  const Eigen::Isometry3f T = T_camera_object.cast<float>();
  double lowest = std::numeric_limits<double>::infinity();
  for (const auto& p : model.points) lowest = std::min(lowest, heightAbove(table, T * p));
  const double gap = std::min(std::abs(lowest), MAX_CONTACT_GAP) / CONTACT_NOISE;
  return gap * gap / 2;
}

/// ICP of the points from a start, and how they lie then. `table`: null for none.
Fit fitOf(const NearestGrid& grid, const Surface& surface, const Eigen::Isometry3d& start,
          const Surface& points, const PlanarSurface& source, const Table* table,
          const RefineOptions& fine) {
  const auto alignment = refinePose(source, grid, start, fine);
  Fit fit;
  fit.T_camera_object = alignment ? alignment->T_camera_object : start;
  const Eigen::Isometry3f T_object_camera = fit.T_camera_object.inverse().cast<float>();
  double sum = 0, neighbors = 0, before = 0;
  for (const auto& point : points.points) {
    const Eigen::Vector3f p = T_object_camera * point;
    const int nearest = grid.nearest(p);
    double off = TURN_DISTANCE;
    if (nearest >= 0) {
      const Eigen::Vector3f away = p - surface.points[nearest];
      if (away.norm() < TURN_DISTANCE) off = away.dot(surface.normals[nearest]);
    }
    sum += off * off;
    neighbors += off * before;
    before = off;
  }
  fit.mean_square = sum / static_cast<double>(points.size());
  fit.correlation = std::clamp(neighbors / std::max(sum, 1e-12), 0.0, 0.99);
  if (table) fit.contact_cost = contactCost(surface, fit.T_camera_object, *table);
  return fit;
}

/// The fit of least cost; another than the first has to be the better by MIN_TURN_GAIN.
const Fit& bestOf(const std::vector<Fit>& fits, std::size_t points) {
  double correlation = 1;
  for (const auto& fit : fits) correlation = std::min(correlation, fit.correlation);
  const double independent = std::pow((1 - correlation) / (1 + correlation), 2);
  const double variance = fits.front().mean_square + FINEST_RMS * FINEST_RMS;
  const auto costOf = [&](const Fit& fit) {
    return independent * static_cast<double>(points) * fit.mean_square / (2 * variance) +
           fit.contact_cost;
  };
  const Fit* best = &fits.front();
  for (const auto& fit : fits) {
    const double least = costOf(*best) - (best == &fits.front() ? MIN_TURN_GAIN : 0);
    if (costOf(fit) < least) best = &fit;
  }
  return *best;
}

}  // namespace

std::optional<SettledPose> settleTurn(const ModelIndex& index, int model,
                                      const Eigen::Isometry3d& T_camera_object,
                                      const std::vector<Eigen::Vector3f>& points,
                                      const std::vector<Table>& tables,
                                      const RefineOptions& refine) {
  const Surface near =
      pointsNearModel(index, model, T_camera_object, points, TURN_REACH, MAX_TURN_POINTS);
  if (near.empty()) return std::nullopt;
  const Table* table =
      tables.empty() ? nullptr : &tables[tableUnder(tables, centroidOf(near.points))];
  RefineOptions fine = refine;
  fine.start_distance = fine.max_distance = TURN_DISTANCE;
  const PlanarSurface source(near);
  const auto fit = [&](const Eigen::Isometry3d& start) {
    return fitOf(index.grid(model), index.models()[model].surface, start, near, source, table,
                 fine);
  };
  std::vector<Fit> fits{fit(T_camera_object)};
  for (const auto& turn : index.sparse(model).turns) fits.push_back(fit(T_camera_object * turn));
  const Fit& best = bestOf(fits, near.size());
  return SettledPose{best.T_camera_object, std::sqrt(best.mean_square)};
}

}  // namespace tabletop_perception
