#include "settle_turn.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unordered_map>

#include "lowest_point.h"
#include "near_model.h"
#include "outline.h"
#include "simd.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/symmetry.h"
#include "voxel_key.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t MAX_TURN_POINTS = 3000;  // that tell near symmetries apart
constexpr std::size_t FEW_TURN_POINTS = 400;   // that tell the hopeless ones
constexpr int COARSE_ITERATIONS = 15;          // of ICP with these
constexpr double HOPELESS = 14;                // log likelihood ratio to the likeliest
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

/// A turn of an object, and how the points about it lie on the model then.
struct Fit {
  Eigen::Isometry3d T_camera_object = Eigen::Isometry3d::Identity();
  bool at_hand = false;         ///< it is the turn that agreed with the picture
  std::vector<float> squares;   ///< of the points' distances from the model's tangent planes [m^2]
  double mean_square = 0;       ///< of them [m^2]
  double contact_cost = 0;      ///< negative log likelihood of its height above the table
  std::optional<double> color;  ///< likeness of the colours
  double color_cost = 0;        ///< negative log likelihood of them
  OffOutline outline;           ///< where it is not the one that is seen
  double cost = 0;              ///< of everything, the points included
};

/// What the turns of an object are held against.
struct Scene {
  const ModelIndex& index;
  int model;
  Surface points;        ///< about it
  PlanarSurface source;  ///< the same
  const ColoredPoints& colored;
  const Table* table;          ///< null for none
  const SeenOutline* outline;  ///< null: it does not count
};

/// How unlikely it is that a model stands on the table like this: negative log likelihood.
double contactCost(const Surface& model, const Eigen::Isometry3d& T_camera_object,
                   const Table& table) {
  const double lowest = lowestAbove(table, T_camera_object, model.points);
  const double gap = std::min(std::abs(lowest), MAX_CONTACT_GAP) / CONTACT_NOISE;
  return gap * gap / 2;
}

/// Turns a fit about its axis of symmetry as the colours have it, and notes how they agree.
void spinByColor(const Scene& scene, Fit& fit) {
  const Eigen::Isometry3d start = fit.T_camera_object;
  for (const auto& spin : scene.index.sparse(scene.model).spins) {
    const auto color =
        colorLikeness(scene.index, scene.model, start * spin, scene.colored, TURN_REACH);
    if (!color) return;
    if (fit.color && *color < *fit.color + MIN_SPIN_GAIN) continue;
    fit.color = color;
    fit.T_camera_object = start * spin;
  }
  fit.color_cost = -COLOR_PATCHES * std::log(std::max(*fit.color, LEAST_LIKENESS));
}

/// Squared distances of points from the model's tangent planes [m^2].
TABLETOP_SIMD_CLONES void squareOffsets(const Correspondences& block, float* squares) {
  constexpr auto FAR = static_cast<float>(TURN_DISTANCE * TURN_DISTANCE);
  for (int i = 0; i < Correspondences::SIZE; ++i) {
    const float off =
        block.dx[i] * block.nx[i] + block.dy[i] * block.ny[i] + block.dz[i] * block.nz[i];
    squares[i] = block.squared[i] <= FAR ? off * off : FAR;
  }
}

/// ICP of the points from where a fit is, and how they lie then.
Fit fitFrom(const Fit& start, const Scene& scene, const RefineOptions& refine) {
  const auto& grid = scene.index.grid(scene.model);
  const auto& surface = scene.index.models()[scene.model].surface;
  const auto alignment = refinePose(scene.source, grid, start.T_camera_object, refine);
  Fit fit;
  fit.at_hand = start.at_hand;
  fit.T_camera_object = alignment ? alignment->T_camera_object : start.T_camera_object;
  const Eigen::Isometry3f T_object_camera = fit.T_camera_object.inverse().cast<float>();
  Correspondences block;
  fit.squares.resize(scene.source.blocks.size() * Correspondences::SIZE);
  for (std::size_t b = 0; b < scene.source.blocks.size(); ++b) {
    grid.correspond(scene.source.blocks[b], T_object_camera,
                    static_cast<float>(TURN_DISTANCE * TURN_DISTANCE), block, 0);
    squareOffsets(block, &fit.squares[b * Correspondences::SIZE]);
  }
  fit.squares.resize(scene.points.size());
  const double sum = std::accumulate(fit.squares.begin(), fit.squares.end(), 0.0);
  fit.mean_square = sum / static_cast<double>(scene.points.size());
  if (scene.table) fit.contact_cost = contactCost(surface, fit.T_camera_object, *scene.table);
  spinByColor(scene, fit);
  if (scene.outline) fit.outline = scene.outline->offAt(fit.T_camera_object);
  return fit;
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
  // Of each patch; there are no more patches than points.
  std::vector<double> against(patches.size(), 0), sizes(patches.size(), 0);
  for (std::size_t i = 0; i < patches.size(); ++i) {
    against[patches[i]] += fit.squares[i] - closest.squares[i];
    ++sizes[patches[i]];
  }
  const double sum = std::accumulate(against.begin(), against.end(), 0.0);
  const double mean = sum / static_cast<double>(patches.size());  // of a point
  double variance = 0;
  for (std::size_t k = 0; k < against.size(); ++k) {
    const double off = against[k] - mean * sizes[k];
    variance += off * off;
  }
  return variance > 0 ? sum * sum / variance / 2 : 0;
}

/// Fits from where others are, the likeliest first.
std::vector<Fit> fitsFrom(const std::vector<Fit>& starts, const Scene& scene,
                          const RefineOptions& refine) {
  std::vector<Fit> fits;
  for (const auto& start : starts) fits.push_back(fitFrom(start, scene, refine));
  const Fit closest = *std::min_element(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) {
    return a.mean_square < b.mean_square;
  });
  const OffOutline cleanest =
      std::min_element(fits.begin(), fits.end(), [](const Fit& a, const Fit& b) {
        return a.outline.pixels < b.outline.pixels;
      })->outline;
  const auto patches = patchesOf(scene.points.points, starts.front().T_camera_object);
  for (auto& fit : fits)
    fit.cost = shapeCost(fit, closest, patches) + fit.contact_cost + fit.color_cost +
               outlineCost(fit.outline, cleanest) - (fit.at_hand ? TURN_AT_HAND : 0);
  std::stable_sort(fits.begin(), fits.end(),
                   [](const Fit& a, const Fit& b) { return a.cost < b.cost; });
  return fits;
}

/// The motions after which a model is as good as in the same pose. Which end of a thing of
/// revolution is up counts, however alike they are, unless its user says that it does not.
std::vector<Eigen::Isometry3d> sameMotions(Symmetry symmetry) {
  if (symmetry.continuous() && !symmetry.declared) symmetry.rotations.clear();
  return symmetryMotions(symmetry);
}

/// The share of the likelihood that those fits have which are the first one's pose, up to the
/// symmetry.
double probabilityOfFirst(const std::vector<Fit>& fits, const Symmetry& symmetry) {
  const auto motions = sameMotions(symmetry);
  const Fit& first = fits.front();
  double same = 0, all = 0;
  for (const auto& fit : fits) {
    const double likelihood = std::exp(first.cost - fit.cost);
    const Eigen::Matrix3d between =
        first.T_camera_object.linear().transpose() * fit.T_camera_object.linear();
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
                                      const ColoredPoints& colored, const SeenOutline* outline,
                                      const std::vector<Table>& tables,
                                      const RefineOptions& refine) {
  const Surface near =
      pointsNearModel(index, model, T_camera_object, points, TURN_REACH, MAX_TURN_POINTS);
  if (near.empty()) return std::nullopt;
  const Table* table =
      tables.empty() ? nullptr : &tables[tableUnder(tables, centroidOf(near.points))];
  RefineOptions fine = refine;
  fine.start_distance = fine.max_distance = TURN_DISTANCE;
  const auto sceneOf = [&](const Surface& points_about, const SeenOutline* seen) -> Scene {
    return {index, model, points_about, points_about, colored, table, seen};
  };
  std::vector<Fit> fits(1);
  fits.front().T_camera_object = T_camera_object;
  fits.front().at_hand = true;
  for (const auto& turn : index.sparse(model).turns) {
    fits.emplace_back();
    fits.back().T_camera_object = T_camera_object * turn;
  }
  fits = fitsFrom(fits, sceneOf(thinned(near, FEW_TURN_POINTS), nullptr), fine);
  const double hopeless = fits.front().cost + HOPELESS;
  fits.erase(
      std::find_if(fits.begin(), fits.end(), [&](const Fit& fit) { return fit.cost > hopeless; }),
      fits.end());
  fits = fitsFrom(fits, sceneOf(near, fits.size() > 1 ? outline : nullptr), fine);
  const Fit& best = fits.front();
  return SettledPose{best.T_camera_object, std::sqrt(best.mean_square), best.color,
                     probabilityOfFirst(fits, index.models()[model].symmetry)};
}

}  // namespace tabletop_perception
