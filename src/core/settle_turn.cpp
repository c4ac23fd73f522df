#include "settle_turn.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "near_model.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/symmetry.h"
#include "voxel_key.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t MAX_TURN_POINTS = 3000;  // that tell near symmetries apart
constexpr double TURN_REACH = 0.015;           // of points about the model that count [m]
constexpr double TURN_DISTANCE = 0.006;        // farther off a point says no more [m]
constexpr double CONTACT_NOISE = 0.001;        // of the table's height under an object [m]
constexpr double MAX_CONTACT_GAP =
    0.004;                            // farther above or below it an object is held otherwise [m]
constexpr double COLOR_PATCHES = 30;  // of an object whose likeness in colour is independent, about
constexpr double LEAST_LIKENESS = 0.01;
constexpr double MIN_SPIN_GAIN = 0.02;  // of likeness, to turn an object about its axis
constexpr double PATCH = 0.02;      // over which the distances of points are off alike, about [m]
constexpr double TURN_AT_HAND = 1;  // log likelihood of the turn that agreed with the picture
constexpr double SAME_TURN = 0.25;  // turns nearer than this are one, up to the symmetry [rad]

/// How all points about a model lie on it.
struct Fit {
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  std::vector<float> squares;   ///< of the points' distances from the model's tangent planes [m^2]
  double mean_square = 0;       ///< of them [m^2]
  double contact_cost = 0;      ///< negative log likelihood of its height above the table
  std::optional<double> color;  ///< likeness of the colours
  double color_cost = 0;        ///< negative log likelihood of them
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
  double sum = 0;
  for (const auto& point : points.points) {
    const Eigen::Vector3f p = T_object_camera * point;
    const int nearest = grid.nearest(p);
    double off = TURN_DISTANCE;
    if (nearest >= 0) {
      const Eigen::Vector3f away = p - surface.points[nearest];
      if (away.norm() < TURN_DISTANCE) off = away.dot(surface.normals[nearest]);
    }
    fit.squares.push_back(static_cast<float>(off * off));
    sum += off * off;
  }
  fit.mean_square = sum / static_cast<double>(points.size());
  if (table) fit.contact_cost = contactCost(surface, fit.T_camera_object, *table);
  return fit;
}

/// Turns a fit about its axis of symmetry as the colours have it, and notes how they agree.
void spinByColor(const ModelIndex& index, int model, const ColoredPoints& colored, Fit& fit) {
  const Eigen::Isometry3d start = fit.T_camera_object;
  for (const auto& spin : index.sparse(model).spins) {
    const auto color = colorLikeness(index, model, start * spin, colored, TURN_REACH);
    if (!color) return;
    if (fit.color && *color < *fit.color + MIN_SPIN_GAIN) continue;
    fit.color = color;
    fit.T_camera_object = start * spin;
  }
  fit.color_cost = -COLOR_PATCHES * std::log(std::max(*fit.color, LEAST_LIKENESS));
}

/// The patch of each point, counted from 0; in the object's frame, where nothing depends on the
/// camera's.
std::vector<int> patchesOf(const std::vector<Eigen::Vector3f>& points,
                           const Eigen::Isometry3d& T_camera_object) {
  const Eigen::Isometry3f T_object_camera = T_camera_object.inverse().cast<float>();
  std::unordered_map<VoxelKey, int, VoxelKeyHash> numbers;
  std::vector<int> patches;
  for (const auto& p : points)
    patches.push_back(numbers
                          .try_emplace(VoxelKey::of(T_object_camera * p, 1 / PATCH),
                                       static_cast<int>(numbers.size()))
                          .first->second);
  return patches;
}

/// How much less likely the points make a fit than the closest one, as a negative log likelihood:
/// how many standard deviations the sum of what each patch has against it is off zero (Vuong 1989).
/// Patches and not points, because a real camera's errors are alike over centimetres.
double shapeCost(const Fit& fit, const Fit& closest, const std::vector<int>& patches) {
  std::vector<double> against(patches.size(), 0);  // no more patches than points
  for (std::size_t i = 0; i < patches.size(); ++i)
    against[patches[i]] += fit.squares[i] - closest.squares[i];
  double sum = 0, variance = 0;
  for (const double of_patch : against) {
    sum += of_patch;
    variance += of_patch * of_patch;
  }
  return variance > 0 ? sum * sum / variance / 2 : 0;
}

/// Negative log likelihoods.
std::vector<double> costsOf(const std::vector<Fit>& fits, const std::vector<int>& patches) {
  const auto& closest = *std::min_element(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) {
    return a.mean_square < b.mean_square;
  });
  std::vector<double> costs;
  for (const auto& fit : fits)
    costs.push_back(shapeCost(fit, closest, patches) + fit.contact_cost + fit.color_cost);
  costs.front() -= TURN_AT_HAND;
  return costs;
}

/// The motions after which a model is as good as in the same pose. Which end of a thing of
/// revolution is up counts, however alike they are, unless its user says that it does not.
std::vector<Eigen::Isometry3d> sameMotions(Symmetry symmetry) {
  if (symmetry.continuous() && !symmetry.declared) symmetry.rotations.clear();
  return symmetryMotions(symmetry);
}

/// The share of the likelihood that those fits have which are the best one's pose, up to the
/// symmetry.
double probabilityOf(std::size_t best, const std::vector<Fit>& fits,
                     const std::vector<double>& costs, const Symmetry& symmetry) {
  const auto motions = sameMotions(symmetry);
  const Eigen::Matrix3d R_best = fits[best].T_camera_object.linear();
  double same = 0, all = 0;
  for (std::size_t k = 0; k < fits.size(); ++k) {
    const double likelihood = std::exp(costs[best] - costs[k]);
    const Eigen::Matrix3d between = R_best.transpose() * fits[k].T_camera_object.linear();
    const bool is_same = std::any_of(motions.begin(), motions.end(), [&](const auto& motion) {
      return angleOf(motion.linear().transpose() * between) < SAME_TURN;
    });
    all += likelihood;
    same += is_same ? likelihood : 0;
  }
  return same / all;
}

}  // namespace

std::optional<SettledPose> settleTurn(const ModelIndex& index, int model,
                                      const Eigen::Isometry3d& T_camera_object,
                                      const std::vector<Eigen::Vector3f>& points,
                                      const ColoredPoints& colored,
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
  for (auto& each : fits) spinByColor(index, model, colored, each);
  const auto costs = costsOf(fits, patchesOf(near.points, T_camera_object));
  const auto best = std::min_element(costs.begin(), costs.end()) - costs.begin();
  return SettledPose{fits[best].T_camera_object, std::sqrt(fits[best].mean_square),
                     fits[best].color,
                     probabilityOf(best, fits, costs, index.models()[model].symmetry)};
}

}  // namespace tabletop_perception
