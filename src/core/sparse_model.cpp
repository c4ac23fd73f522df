#include "tabletop_perception/sparse_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "simd.h"
#include "tabletop_perception/kd_tree.h"
#include "tabletop_perception/mesh.h"
#include "tabletop_perception/rests.h"
#include "tabletop_perception/symmetry.h"

namespace tabletop_perception {
namespace {

constexpr double MIN_LEAF = 0.006;        // spacing of the points of a small model [m]
constexpr double LEAF_RATIO = 0.05;       // and of a large one, share of its diameter
constexpr float MIN_FACING = 0.2f;        // cosine to the line of sight; flatter points say nothing
constexpr double RASTER_CELL = 0.006;     // in which a model hides its own back [m]
constexpr float HIDING_GAP = 0.009f;      // how much nearer the hiding part lies [m]
constexpr int MAX_RASTER = 512;           // cells along one side of it
constexpr double MIN_PROBABILITY = 0.01;  // of a stand that is worth a look
constexpr int MAX_STANDS = 12;
constexpr double SAME_STAND = 0.17;  // stands that tilt less from each other are one [rad]
constexpr int YAWS = 24;             // turns about the vertical, within the reach of ICP
constexpr int SPINS = 24;            // turns about an axis of symmetry
constexpr double SAME_YAW = 0.13;    // turns nearer than this are one, up to the symmetry [rad]
constexpr float NEARLY_THE_SAME = 0.01f;  // from where a turned model's surface was [m]
constexpr double MIN_NEARLY_SAME = 0.9;   // share of the surface that is so after a near symmetry

/// Orthographic depth of a surface seen from a direction.
class DepthRaster {
 public:
  DepthRaster(const Surface& surface, const Eigen::Vector3f& direction)
      : to_raster_(
            rotationBetween(direction.cast<double>(), Eigen::Vector3d::UnitZ()).cast<float>()) {
    Eigen::Vector3f high = to_raster_ * surface.points.front();
    low_ = high;
    for (const auto& p : surface.points) {
      low_ = low_.cwiseMin(to_raster_ * p);
      high = high.cwiseMax(to_raster_ * p);
    }
    const float wide = (high - low_).head<2>().maxCoeff();
    cell_ = std::max(static_cast<float>(RASTER_CELL), wide / MAX_RASTER);
    side_ = static_cast<int>(wide / cell_) + 1;
    nearest_.assign(static_cast<std::size_t>(side_) * side_, -std::numeric_limits<float>::max());
    for (const auto& p : surface.points) {
      const Eigen::Vector3f q = to_raster_ * p;
      nearest_[cellOf(q)] = std::max(nearest_[cellOf(q)], q.z());
    }
  }

  /// `slope`: cosine of the point's normal to the line of sight.
  bool hides(const Eigen::Vector3f& p, float slope) const {
    const Eigen::Vector3f q = to_raster_ * p;
    return q.z() < nearest_[cellOf(q)] - HIDING_GAP - cell_ * (1 / slope - 1);
  }

 private:
  std::size_t cellOf(const Eigen::Vector3f& q) const {
    const int u = static_cast<int>((q.x() - low_.x()) / cell_);
    const int v = static_cast<int>((q.y() - low_.y()) / cell_);
    return static_cast<std::size_t>(std::clamp(v, 0, side_ - 1)) * side_ +
           std::clamp(u, 0, side_ - 1);
  }

  Eigen::Matrix3f to_raster_;
  Eigen::Vector3f low_;
  float cell_ = 0;
  int side_ = 0;
  std::vector<float> nearest_;
};

/// Directions as planar arrays, filled up to whole registers.
class Directions {
 public:
  explicit Directions(const std::vector<Eigen::Vector3d>& directions)
      : size_((directions.size() + LANES - 1) / LANES * LANES) {
    for (std::vector<float>* axis : {&x_, &y_, &z_}) axis->assign(size_, 0.0f);
    for (std::size_t i = 0; i < directions.size(); ++i) {
      x_[i] = static_cast<float>(directions[i].x());
      y_[i] = static_cast<float>(directions[i].y());
      z_[i] = static_cast<float>(directions[i].z());
    }
  }

  /// The index of the one at the smallest angle to a direction; the first of several.
  std::size_t nearest(const Eigen::Vector3f& direction) const {
    std::vector<float> cosines(size_);
    const float most = multiply(x_.data(), y_.data(), z_.data(), size_, direction.x(),
                                direction.y(), direction.z(), cosines.data());
    return std::find(cosines.begin(), cosines.end(), most) - cosines.begin();
  }

 private:
  static constexpr std::size_t LANES = 8;

  /// The products with all directions, and the largest.
  static float multiply(const float* xs, const float* ys, const float* zs, std::size_t size,
                        float x, float y, float z, float* products);

  std::size_t size_;
  std::vector<float> x_, y_, z_;
};

TABLETOP_SIMD_CLONES float Directions::multiply(const float* xs, const float* ys, const float* zs,
                                                std::size_t size, float x, float y, float z,
                                                float* products) {
  float most[LANES];
  std::fill(most, most + LANES, -2.0f);
  for (std::size_t i = 0; i < size; i += LANES)
    for (std::size_t lane = 0; lane < LANES; ++lane) {
      const float product = xs[i + lane] * x + ys[i + lane] * y + zs[i + lane] * z;
      products[i + lane] = product;
      most[lane] = std::max(most[lane], product);
    }
  return *std::max_element(most, most + LANES);
}

SparseModel::Side sideOf(const Surface& dense, const Surface& sparse,
                         const Eigen::Vector3f& direction) {
  const DepthRaster raster(dense, direction);
  SparseModel::Side side;
  side.direction = direction;
  Eigen::AlignedBox3f box;
  Surface visible;
  for (std::size_t i = 0; i < sparse.size(); ++i) {
    const float slope = sparse.normals[i].dot(direction);
    if (slope < MIN_FACING || raster.hides(sparse.points[i], slope)) continue;
    side.visible.push_back(static_cast<int>(i));
    visible.points.push_back(sparse.points[i]);
    visible.normals.push_back(sparse.normals[i]);
    side.centroid += sparse.points[i];
    box.extend(sparse.points[i]);
  }
  if (side.visible.empty()) return side;
  side.surface = visible;
  side.centroid /= static_cast<float>(side.visible.size());
  side.extent = box.diagonal().norm();
  return side;
}

/// The yaws that do not look alike for an object that stands like this.
std::vector<double> distinctYaws(const Eigen::Matrix3d& R_table_object,
                                 const std::vector<Eigen::Isometry3d>& motions) {
  std::vector<double> yaws;
  const auto turned = [&](double yaw) -> Eigen::Matrix3d {
    return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * R_table_object;
  };
  for (int k = 0; k < YAWS; ++k) {
    const double yaw = 2 * M_PI * k / YAWS;
    const bool known = std::any_of(yaws.begin(), yaws.end(), [&](double other) {
      const Eigen::Matrix3d between = turned(other).transpose() * turned(yaw);
      return std::any_of(motions.begin(), motions.end(), [&](const Eigen::Isometry3d& motion) {
        return angleOf(between * motion.linear()) < SAME_YAW;
      });
    });
    if (!known) yaws.push_back(yaw);
  }
  return yaws;
}

std::vector<SparseModel::Stand> standsOf(const ObjectModel& model) {
  std::vector<Rest> rests;
  try {
    rests = stableRests(model.surface.points);
  } catch (const std::invalid_argument&) {
    return {};  // a flat part of a surface
  }
  const auto motions = symmetryMotions(model.symmetry);
  std::vector<SparseModel::Stand> stands;
  for (const auto& rest : rests) {
    if (rest.probability < MIN_PROBABILITY || stands.size() == MAX_STANDS) break;
    const Eigen::Matrix3d R = rest.T_table_object.linear();
    const Eigen::Vector3d up = R.row(2);
    const bool known = std::any_of(stands.begin(), stands.end(), [&](const auto& other) {
      const Eigen::Vector3d other_up = other.R_table_object.row(2);
      return std::any_of(motions.begin(), motions.end(), [&](const Eigen::Isometry3d& motion) {
        return (motion.linear() * up).dot(other_up) > std::cos(SAME_STAND);
      });
    });
    if (known) continue;
    double top = 0;
    for (const auto& p : model.surface.points)
      top = std::max(top, (rest.T_table_object * p.cast<double>()).z());
    stands.push_back({R, rest.T_table_object.translation().z(), top, distinctYaws(R, motions)});
  }
  return stands;
}

/// The turns of a cube: all right-handed ways to lay three axes onto each other, the identity left
/// out.
std::vector<Eigen::Matrix3d> turnsOfCube() {
  std::vector<Eigen::Matrix3d> turns;
  for (int x = 0; x < 3; ++x)
    for (int y = 0; y < 3; ++y)
      for (const int signs : {0, 1, 2, 3}) {
        if (x == y) continue;
        Eigen::Matrix3d turn;
        turn.col(0) = (signs & 1 ? -1 : 1) * Eigen::Vector3d::Unit(x);
        turn.col(1) = (signs & 2 ? -1 : 1) * Eigen::Vector3d::Unit(y);
        turn.col(2) = turn.col(0).cross(turn.col(1));
        if (!turn.isIdentity()) turns.push_back(turn);
      }
  return turns;
}

/// Share of a surface that lies on it after a motion.
double shareOnItself(const Surface& sparse, const KdTree& dense, const Eigen::Isometry3d& motion) {
  const Eigen::Isometry3f T = motion.cast<float>();
  int on = 0;
  for (const auto& p : sparse.points)
    on += dense.nearest(T * p).squared_distance < NEARLY_THE_SAME * NEARLY_THE_SAME;
  return on / static_cast<double>(sparse.size());
}

std::vector<Eigen::Isometry3d> nearSymmetries(const ObjectModel& model, const Surface& sparse) {
  const Eigen::Matrix3d axes = dominantAxes(model.surface);
  Eigen::AlignedBox3d box;
  for (const auto& p : model.surface.points) box.extend(axes.transpose() * p.cast<double>());
  const KdTree dense(model.surface.points);
  Symmetry certain = model.symmetry;
  if (!certain.declared) certain.rotations.clear();
  auto known = symmetryMotions(certain);
  std::vector<Eigen::Isometry3d> turns;
  for (const auto& of_cube : turnsOfCube()) {
    const Eigen::Matrix3d turn = axes * of_cube * axes.transpose();
    const auto alike = [&](const Eigen::Isometry3d& other) {
      return angleOf(other.linear().transpose() * turn) < SAME_YAW;
    };
    if (std::any_of(known.begin(), known.end(), alike)) continue;
    const Eigen::Vector3d center = axes * box.center();
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.translate(center);
    motion.rotate(turn).translate(-center);
    if (shareOnItself(sparse, dense, motion) < MIN_NEARLY_SAME) continue;
    turns.push_back(motion);
    for (const auto& certainly : symmetryMotions(certain)) known.push_back(motion * certainly);
  }
  return turns;
}

std::vector<Eigen::Isometry3d> spinsOf(Symmetry symmetry) {
  symmetry.rotations.clear();
  return symmetryMotions(symmetry, SPINS);
}

/// The symmetry's motions and the turns, one after the other and one upon the other.
std::vector<Eigen::Isometry3d> motionsAlike(const Symmetry& symmetry,
                                            const std::vector<Eigen::Isometry3d>& turns) {
  std::vector<Eigen::Isometry3d> alike;
  const auto add = [&](const Eigen::Isometry3d& motion) {
    const auto same = [&](const Eigen::Isometry3d& other) {
      return angleOf(other.linear().transpose() * motion.linear()) < SAME_YAW;
    };
    if (angleOf(motion.linear()) >= SAME_YAW && std::none_of(alike.begin(), alike.end(), same))
      alike.push_back(motion);
  };
  for (const auto& motion : symmetryMotions(symmetry, SPINS)) {
    add(motion);
    for (const auto& turn : turns) add(turn * motion);
  }
  return alike;
}

}  // namespace

const SparseModel::Side& SparseModel::sideTowards(const Eigen::Vector3f& direction) const {
  static const Directions directions(icosphereDirections());
  return sides[directions.nearest(direction)];
}

SparseModel makeSparse(const ObjectModel& model) {
  SparseModel sparse;
  sparse.surface = downsampled(model.surface, std::max(MIN_LEAF, LEAF_RATIO * model.diameter));
  for (const auto& direction : icosphereDirections())
    sparse.sides.push_back(sideOf(model.surface, sparse.surface, direction.cast<float>()));
  sparse.stands = standsOf(model);
  sparse.turns = nearSymmetries(model, sparse.surface);
  sparse.spins = spinsOf(model.symmetry);
  if (!model.symmetry.continuous()) sparse.axis = axisOfMost(model.surface);
  sparse.alike = motionsAlike(model.symmetry, sparse.turns);
  return sparse;
}

}  // namespace tabletop_perception
