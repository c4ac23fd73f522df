#include "tabletop_perception/agreement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int SIZE = PlanarBlock::SIZE;
constexpr float NONE = std::numeric_limits<float>::quiet_NaN();
constexpr float MOST = std::numeric_limits<float>::max();  // more, infinite, is no correspondence
constexpr float MIN_FACING = 0.3f;  // cosine to the line of sight; flatter surfaces count as this
constexpr double HALF_LIKENESS = 0.1;  // of colours that halve an agreement, about
constexpr double DEPTH_SLACK = 1.5;    // of what is seen at an angle, in tolerances

/// Calls visit(correspondences) for each block of points, at a pose of a model.
template <typename Visit>
void visitCorrespondences(const ModelIndex& index, int model,
                          const Eigen::Isometry3d& T_camera_object, const PlanarSurface& points,
                          double tolerance, Visit visit) {
  const Eigen::Isometry3f T_object_camera = T_camera_object.inverse().cast<float>();
  const auto max_squared = static_cast<float>(tolerance * tolerance);
  Correspondences block;
  for (const auto& some : points.blocks) {
    index.grid(model).correspond(some, T_object_camera, max_squared, block);
    visit(block);
  }
}

/// What is left of an agreement in shape: 1 for equal colours, nearly so for those that a camera
/// shows of the same thing, and little for others.
double colorFactor(double likeness) {
  return likeness * (1 + HALF_LIKENESS) / (likeness + HALF_LIKENESS);
}

/// A bit for each correspondence that there is.
TABLETOP_SIMD_CLONES std::uint32_t bitsOf(const Correspondences& block) {
  static_assert(SIZE == 32);
  std::uint32_t bits = 0;
  for (int i = 0; i < SIZE; ++i) bits |= static_cast<std::uint32_t>(block.squared[i] <= MOST) << i;
  return bits;
}

/// Adds the squared distances of those that there are, eight sums side by side.
TABLETOP_SIMD_CLONES void addSquared(const Correspondences& block, float* lanes) {
  for (int i = 0; i < SIZE; i += 8)
    for (int lane = 0; lane < 8; ++lane)
      lanes[lane] += zeroUnless(block.squared[i + lane] <= MOST, block.squared[i + lane]);
}

/// A pose and a camera as the kernel needs them.
struct Sight {
  float T[12];  // rows of rotation and translation
  float fx, fy, cx, cy, width, height, forward;
  float slack, tolerance;
};

/// What a block of a model shows.
struct Shown {
  int seen = 0, violated = 0;
};

/// Range and slack of points of a model, and the pixels where they should appear; -1 for none.
TABLETOP_SIMD_CLONES void project(const PlanarBlock& __restrict model,
                                  const Sight& __restrict sight, float* __restrict ranges,
                                  float* __restrict slacks, std::int32_t* __restrict pixels) {
  const float* T = sight.T;
  const auto width = static_cast<std::int32_t>(sight.width);
  const auto height = static_cast<std::int32_t>(sight.height);
  for (int i = 0; i < SIZE; ++i) {
    const float x = T[0] * model.x[i] + T[1] * model.y[i] + T[2] * model.z[i] + T[3];
    const float y = T[4] * model.x[i] + T[5] * model.y[i] + T[6] * model.z[i] + T[7];
    const float z = T[8] * model.x[i] + T[9] * model.y[i] + T[10] * model.z[i] + T[11];
    const float nx = T[0] * model.nx[i] + T[1] * model.ny[i] + T[2] * model.nz[i];
    const float ny = T[4] * model.nx[i] + T[5] * model.ny[i] + T[6] * model.nz[i];
    const float nz = T[8] * model.nx[i] + T[9] * model.ny[i] + T[10] * model.nz[i];
    const float range = std::sqrt(x * x + y * y + z * z);
    const float facing = -(nx * x + ny * y + nz * z) / range;
    // One more than the pixel, where truncation is floor; half a pixel on, as the nearest is the
    // one below. The order of arguments turns NaN into 0.
    const float right =
        std::min(sight.width + 1, std::max(0.0f, sight.fx * x / z + sight.cx + 1.5f));
    const float down =
        std::min(sight.height + 1, std::max(0.0f, sight.fy * y / z + sight.cy + 1.5f));
    const std::int32_t u = static_cast<std::int32_t>(right) - 1;
    const std::int32_t v = static_cast<std::int32_t>(down) - 1;
    // All bits set where one of them is negative. By bits: a choice would become a jump.
    const std::int32_t outside = (u | v | (width - 1 - u) | (height - 1 - v)) >> 31;
    const std::int32_t behind = static_cast<std::int32_t>(z * sight.forward > 0) - 1;
    ranges[i] = range;
    slacks[i] = sight.slack / std::max(MIN_FACING, facing);
    pixels[i] = (v * width + u) | outside | behind;
  }
}

/// What the camera saw where a point of the model should be. The table where the model should be
/// says nothing: it lies within tolerance of every model's foot.
TABLETOP_SIMD_CLONES Shown classify(const float* ranges, const float* slacks,
                                    const float* seen_ranges, const float* heights,
                                    float tolerance) {
  std::int32_t seen = 0, violated = 0;
  for (int i = 0; i < SIZE; ++i) {
    const float behind = seen_ranges[i] - ranges[i];  // NaN where nothing was seen: neither
    violated += behind > slacks[i];
    seen += (behind <= slacks[i]) & (behind >= -slacks[i]) & (heights[i] >= tolerance);
  }
  return {seen, violated};
}

Shown shownOf(const PlanarBlock& model, const Sight& sight,
              const std::vector<SeenPoint>& sightings) {
  alignas(32) float ranges[SIZE], slacks[SIZE], seen_ranges[SIZE], heights[SIZE];
  alignas(32) std::int32_t pixels[SIZE];
  project(model, sight, ranges, slacks, pixels);
  for (int i = 0; i < SIZE; ++i) {
    const SeenPoint seen = pixels[i] < 0 ? SeenPoint{NONE, 0} : sightings[pixels[i]];
    seen_ranges[i] = seen.range;
    heights[i] = seen.height;
  }
  return classify(ranges, slacks, seen_ranges, heights, sight.tolerance);
}

Sight sightOf(const Observation& observation, const Eigen::Isometry3f& T_camera_object,
              double tolerance) {
  Sight sight;
  Eigen::Map<Eigen::Matrix<float, 3, 4, Eigen::RowMajor>>(sight.T) =
      T_camera_object.matrix().topRows<3>();
  const Projection& projection = *observation.projection;
  sight.fx = static_cast<float>(projection.fx);
  sight.fy = static_cast<float>(projection.fy);
  sight.cx = static_cast<float>(projection.cx);
  sight.cy = static_cast<float>(projection.cy);
  sight.width = static_cast<float>(observation.scene.width);
  sight.height = static_cast<float>(observation.scene.height);
  sight.forward = static_cast<float>(projection.forward);
  sight.slack = static_cast<float>(DEPTH_SLACK * tolerance);
  sight.tolerance = static_cast<float>(tolerance);
  return sight;
}

/// Without a projection only what was seen is known.
Shown shownAmongPoints(const SparseModel& model, const SparseModel::Side& side,
                       const Eigen::Isometry3f& T_camera_object, const KdTree& points,
                       double tolerance) {
  Shown shown;
  for (const int i : side.visible) {
    const auto nearest = points.nearest(T_camera_object * model.surface.points[i]);
    shown.seen += nearest.index >= 0 && nearest.squared_distance <= tolerance * tolerance;
  }
  return shown;
}

void lookForModel(const SparseModel& model, const Eigen::Isometry3d& T_camera_object,
                  const Observation& observation, double tolerance, Agreement& agreement) {
  const Eigen::Isometry3f T = T_camera_object.cast<float>();
  const Eigen::Vector3f from_camera = T.linear().transpose() * T.translation();
  const auto& side = model.sideTowards(-from_camera.normalized());
  if (side.visible.empty()) return;
  Shown shown;
  if (observation.projection) {
    const Sight sight = sightOf(observation, T, tolerance);
    for (const auto& block : side.surface.blocks) {
      const Shown some = shownOf(block, sight, *observation.sightings);
      shown.seen += some.seen;
      shown.violated += some.violated;
    }
  } else {
    shown = shownAmongPoints(model, side, T, *observation.points, tolerance);
  }
  const auto all = static_cast<double>(side.visible.size());
  agreement.visible = shown.seen / all;
  agreement.violation = shown.violated / all;
  agreement.hidden = 1 - agreement.visible - agreement.violation;
}

/// Adds what each point is worth, eight sums side by side.
TABLETOP_SIMD_CLONES void addCloseness(const Correspondences& block, float inverse_limit,
                                       float* lanes) {
  for (int i = 0; i < SIZE; i += 8)
    for (int lane = 0; lane < 8; ++lane)
      lanes[lane] += std::max(0.0f, 1 - block.squared[i + lane] * inverse_limit);
}

std::vector<SeenPoint> sightingsOf(const Cloud& scene, const Table* table) {
  std::vector<SeenPoint> sightings(scene.size());
  const Eigen::Vector4f plane =
      table ? Eigen::Vector4f(table->plane.cast<float>()) : Eigen::Vector4f::Zero();
  const float above = table ? plane[3] : std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const float x = scene.x[i], y = scene.y[i], z = scene.z[i];
    sightings[i].range = std::sqrt(x * x + y * y + z * z);
    sightings[i].height = plane[0] * x + plane[1] * y + plane[2] * z + above;
  }
  return sightings;
}

/// As `known`, with a table.
Observation withTable(Observation known, const Table* table) {
  known.table = table;
  if (known.projection)
    known.sightings = std::make_shared<std::vector<SeenPoint>>(sightingsOf(known.scene, table));
  return known;
}

Observation withoutTable(const Cloud& scene, const std::optional<Projection>& projection) {
  Observation observation{scene, nullptr, projection, nullptr, nullptr, nullptr, hasHues(scene)};
  if (!observation.projection) {
    observation.point_indices = std::make_shared<Indices>(validIndices(scene));
    observation.points = std::make_shared<KdTree>(pointsAt(scene, *observation.point_indices));
  }
  return observation;
}

}  // namespace

Observation observe(const Cloud& scene, const std::optional<Table>& table) {
  return observe(scene, table ? &*table : nullptr, fitProjection(scene).value);
}

Observation observe(const Cloud& scene, const Table* table,
                    const std::optional<Projection>& projection) {
  return withTable(withoutTable(scene, projection), table);
}

Observations::Observations(const Cloud& scene, const std::vector<Table>& tables) : tables_(tables) {
  const Observation observation = withoutTable(scene, fitProjection(scene).value);
  if (tables.empty()) observations_.push_back(withTable(observation, nullptr));
  for (const auto& table : tables) observations_.push_back(withTable(observation, &table));
}

const Observation& Observations::about(const Eigen::Vector3f& middle) const {
  return observations_[tables_.empty() ? 0 : tableUnder(tables_, middle)];
}

double Agreement::score(double tolerance) const {
  return shapeScore(tolerance) * (color ? colorFactor(*color) : 1);
}

double Agreement::shapeScore(double tolerance) const {
  const double seen = visible + violation;
  const double misfit = fitness / tolerance;
  return seen > 0 ? explained * visible / seen * std::exp(-misfit * misfit) : 0;
}

Agreement agreementOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                      const PlanarSurface& points, const Observation& observation,
                      double tolerance) {
  Agreement agreement;
  int explained = 0;
  alignas(32) float lanes[8] = {};
  visitCorrespondences(index, model, T_camera_object, points, tolerance,
                       [&](const Correspondences& block) {
                         explained += __builtin_popcount(bitsOf(block));
                         addSquared(block, lanes);
                       });
  const double sum = std::accumulate(lanes, lanes + 8, 0.0);
  if (explained > 0) {
    agreement.explained = static_cast<double>(explained) / static_cast<double>(points.size);
    agreement.fitness = std::sqrt(sum / explained);
  }
  lookForModel(index.sparse(model), T_camera_object, observation, tolerance, agreement);
  return agreement;
}

double explainedShare(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                      const PlanarSurface& points, double tolerance) {
  int explained = 0;
  visitCorrespondences(
      index, model, T_camera_object, points, tolerance,
      [&](const Correspondences& block) { explained += __builtin_popcount(bitsOf(block)); });
  return explained / std::max<double>(1, static_cast<double>(points.size));
}

double closenessOf(const ModelIndex& index, int model, const Eigen::Isometry3d& T_camera_object,
                   const PlanarSurface& points, double tolerance) {
  alignas(32) float lanes[8] = {};
  const auto inverse_limit = static_cast<float>(1 / (tolerance * tolerance));
  visitCorrespondences(
      index, model, T_camera_object, points, tolerance,
      [&](const Correspondences& block) { addCloseness(block, inverse_limit, lanes); });
  return std::accumulate(lanes, lanes + 8, 0.0) /
         std::max<double>(1, static_cast<double>(points.size));
}

std::vector<std::uint32_t> explainedPoints(const ModelIndex& index, int model,
                                           const Eigen::Isometry3d& T_camera_object,
                                           const PlanarSurface& points, double tolerance) {
  std::vector<std::uint32_t> explained;
  explained.reserve(points.blocks.size());
  visitCorrespondences(index, model, T_camera_object, points, tolerance,
                       [&](const Correspondences& block) { explained.push_back(bitsOf(block)); });
  return explained;
}

}  // namespace tabletop_perception
