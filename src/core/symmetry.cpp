#include "tabletop_perception/symmetry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "tabletop_perception/geometry.h"
#include "tabletop_perception/kd_tree.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t MIN_POINTS = 50;     // fewer tell nothing about a shape
constexpr std::size_t MAX_SAMPLES = 400;   // of the points that are turned and compared
constexpr double EQUAL_EXTENT = 0.85;      // ratio of extents from which on they count as equal
constexpr int MAX_ORDER = 6;               // finer than hexagonal counts as round, if at all
constexpr std::size_t MAX_ROTATIONS = 59;  // an icosahedron has as many
constexpr double SEARCH_STEP = 4 * M_PI / 180;    // between axes that are tried [rad]
constexpr double SAME_AXIS = 12 * M_PI / 180;     // axes nearer than this are one [rad]
constexpr double SAME_TURN = 15 * M_PI / 180;     // so are rotations [rad]
constexpr double FINEST_STEP = 0.1 * M_PI / 180;  // of an axis' refinement [rad]

Eigen::Matrix3d rotationAbout(const Eigen::Vector3d& axis, double angle) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

/// A turn about an axis through `center`.
struct Turn {
  Eigen::Vector3d center;  // [m]
  Eigen::Vector3d axis;    // unit length
  double angle;            // [rad]
  double misfit = 0;       // of the shape turned so [m]
};

/// A shape that is compared with itself turned.
class SelfMatch {
 public:
  explicit SelfMatch(const Surface& surface)
      : surface_(surface),
        tree_(surface.points),
        center_(centroidOf(surface.points).cast<double>()) {
    const std::size_t stride = (surface.size() + MAX_SAMPLES - 1) / MAX_SAMPLES;
    for (std::size_t i = 0; i < surface.size(); i += stride) samples_.push_back(surface.points[i]);

    std::vector<float> gaps;
    std::vector<KdTree::Neighbor> nearest;
    for (const auto& p : samples_) {
      tree_.nearest(p, 2, nearest);
      gaps.push_back(std::sqrt(nearest.back().squared_distance));
    }
    std::nth_element(gaps.begin(), gaps.begin() + gaps.size() / 2, gaps.end());
    reach_ = 1.5f * gaps[gaps.size() / 2];
  }

  const Eigen::Vector3d& center() const { return center_; }  // the centroid [m]

  /// The largest misfit [m] of a symmetry about `axis`: `tolerance` of the radius, but no less than
  /// the sampling can tell.
  double limit(const Eigen::Vector3d& axis, double tolerance) const {
    return std::max(tolerance * radius(axis), reach_ / 4.0);
  }

  /// RMS distance of the shape's points from an axis through the centroid [m].
  double radius(const Eigen::Vector3d& axis) const {
    double sum = 0;
    for (const auto& p : samples_) sum += (p.cast<double>() - center_).cross(axis).squaredNorm();
    return std::sqrt(sum / static_cast<double>(samples_.size()));
  }

  /// How far the turned points lie from the shape: the RMS [m] of their distances to the nearest of
  /// its points, each taken as a disc that reaches to the next point. A dent in a can counts little
  /// in it and the handle of a mug much; the largest distance, or a high quantile, tells them apart
  /// less well.
  double misfit(const Turn& turn, std::size_t stride = 1) const {
    const Eigen::Matrix3f R = rotationAbout(turn.axis, turn.angle).cast<float>();
    const Eigen::Vector3f center = turn.center.cast<float>();
    double sum = 0;
    int count = 0;
    for (std::size_t i = 0; i < samples_.size(); i += stride) {
      const Eigen::Vector3f p = R * (samples_[i] - center) + center;
      const int nearest = tree_.nearest(p).index;
      const Eigen::Vector3f away = p - surface_.points[nearest];
      const float off = away.dot(surface_.normals[nearest]);
      const float along = std::sqrt(std::max(0.0f, away.squaredNorm() - off * off));
      const float beside = std::max(0.0f, along - reach_);
      sum += off * off + beside * beside;
      ++count;
    }
    return std::sqrt(sum / count);
  }

 private:
  const Surface& surface_;
  KdTree tree_;
  Eigen::Vector3d center_;
  std::vector<Eigen::Vector3f> samples_;
  float reach_;  // of the disc about a point [m]
};

/// The turn near the given one that fits best: a pattern search over axis and centre.
Turn refined(const SelfMatch& shape, Turn best) {
  best.misfit = shape.misfit(best);
  for (double step = SEARCH_STEP / 2; step > FINEST_STEP;) {
    const Turn before = best;
    const Eigen::Vector3d side = before.axis.unitOrthogonal();
    for (const Eigen::Vector3d& direction : {side, Eigen::Vector3d(before.axis.cross(side))})
      for (const double way : {step, -step}) {
        Turn tilted = before, shifted = before;
        tilted.axis = (before.axis + std::tan(way) * direction).normalized();
        shifted.center += way * shape.radius(before.axis) * direction;
        for (Turn& turn : {std::ref(tilted), std::ref(shifted)}) {
          turn.misfit = shape.misfit(turn);
          if (turn.misfit < best.misfit) best = turn;
        }
      }
    if (best.misfit >= before.misfit) step /= 2;
  }
  return best;
}

/// Principal axes as columns, largest extent first, and the extents along them.
struct Principal {
  Eigen::Matrix3d axes;
  Eigen::Vector3d extents;

  bool equal(int i, int j) const {
    return std::min(extents[i], extents[j]) >= EQUAL_EXTENT * std::max(extents[i], extents[j]);
  }
};

Principal principalOf(const Surface& surface, const Eigen::Vector3d& center) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const auto& p : surface.points) {
    const Eigen::Vector3d d = p.cast<double>() - center;
    covariance += d * d.transpose() / static_cast<double>(surface.size());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  return {solver.eigenvectors().rowwise().reverse(),
          solver.eigenvalues().reverse().cwiseMax(0).cwiseSqrt()};
}

/// Where the axes of symmetries can lie: every one is a principal axis of the shape, which leaves
/// a plane of directions open where two extents are equal, and all of them where three are.
std::vector<Eigen::Vector3d> possibleAxes(const Principal& principal) {
  std::vector<Eigen::Vector3d> axes;
  for (int i = 0; i < 3; ++i) axes.push_back(principal.axes.col(i));
  const auto addFan = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    for (double angle = SEARCH_STEP; angle < M_PI; angle += SEARCH_STEP)
      axes.push_back(std::cos(angle) * a + std::sin(angle) * b);
  };
  if (principal.equal(0, 1) && principal.equal(1, 2)) {
    const int rings = static_cast<int>(M_PI_2 / SEARCH_STEP);
    for (int ring = 1; ring <= rings; ++ring) {
      const double polar = M_PI_2 * ring / rings;
      const int steps = static_cast<int>(2 * M_PI * std::sin(polar) / SEARCH_STEP);
      for (int k = 0; k < steps; ++k)
        axes.push_back(
            rotationAbout(principal.axes.col(2), 2 * M_PI * k / steps) *
            (std::cos(polar) * principal.axes.col(2) + std::sin(polar) * principal.axes.col(0)));
    }
  } else if (principal.equal(0, 1)) {
    addFan(principal.axes.col(0), principal.axes.col(1));
  } else if (principal.equal(1, 2)) {
    addFan(principal.axes.col(1), principal.axes.col(2));
  }
  return axes;
}

bool sameAxis(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::abs(a.dot(b)) > std::cos(SAME_AXIS);
}

/// Whether every turn about the axis is a symmetry.
bool isRound(const SelfMatch& shape, Turn turn, double tolerance) {
  constexpr int STEPS = 18;
  const double limit = shape.limit(turn.axis, tolerance);
  for (int k = 1; k < STEPS; ++k) {
    turn.angle = M_PI * k / STEPS;
    if (shape.misfit(turn) > limit) return false;
  }
  return true;
}

/// The turns by a full circle over `order` that are symmetries, each refined, best first; if there
/// is one about a round axis, that one alone.
std::vector<Turn> turnsOfOrder(const SelfMatch& shape, const std::vector<Eigen::Vector3d>& axes,
                               int order, double tolerance) {
  std::vector<Turn> coarse;
  for (const auto& axis : axes) {
    Turn turn{shape.center(), axis, 2 * M_PI / order};
    turn.misfit = shape.misfit(turn, 4);
    // Half a step beside the true axis, a half turn is off by another 4 % of the radius.
    if (turn.misfit < shape.limit(axis, tolerance + 0.04)) coarse.push_back(turn);
  }
  const auto byMisfit = [](const Turn& a, const Turn& b) { return a.misfit < b.misfit; };
  std::stable_sort(coarse.begin(), coarse.end(), byMisfit);

  std::vector<Turn> turns;
  std::vector<Eigen::Vector3d> tried;
  for (const Turn& seed : coarse) {
    const auto near = [&](const Eigen::Vector3d& axis) { return sameAxis(axis, seed.axis); };
    if (std::any_of(tried.begin(), tried.end(), near)) continue;
    const Turn best = refined(shape, seed);
    tried.push_back(seed.axis);
    tried.push_back(best.axis);
    if (best.misfit > shape.limit(best.axis, tolerance)) continue;
    if (isRound(shape, best, tolerance)) return {best};
    turns.push_back(best);
  }
  std::stable_sort(turns.begin(), turns.end(), byMisfit);
  return turns;
}

/// The point nearest to all axes, and nearest to `centroid` where they leave it open.
Eigen::Vector3d commonCenter(const std::vector<Turn>& turns, const Eigen::Vector3d& centroid) {
  constexpr double WEIGHT_OF_CENTROID = 1e-3;
  Eigen::Matrix3d A = WEIGHT_OF_CENTROID * Eigen::Matrix3d::Identity();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Turn& turn : turns) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - turn.axis * turn.axis.transpose();
    A += across;
    b += across * (turn.center - centroid);
  }
  return centroid + A.ldlt().solve(b);
}

void addUnlessThere(std::vector<Eigen::Matrix3d>& rotations, const Eigen::Matrix3d& rotation) {
  const auto same = [&](const Eigen::Matrix3d& r) {
    return angleOf(r.transpose() * rotation) < SAME_TURN;
  };
  if (angleOf(rotation) >= SAME_TURN && std::none_of(rotations.begin(), rotations.end(), same))
    rotations.push_back(rotation);
}

/// Adds the products of symmetries: two turns in a row change nothing either.
void closeGroup(std::vector<Eigen::Matrix3d>& rotations) {
  for (std::size_t i = 0; i < rotations.size(); ++i)
    for (std::size_t j = 0; j < rotations.size() && rotations.size() < MAX_ROTATIONS; ++j) {
      const Eigen::Matrix3d product = rotations[i] * rotations[j];
      addUnlessThere(rotations, product);
    }
}

Eigen::Vector3d axisByName(const std::string& name) {
  return Eigen::Vector3d::Unit(name.back() - 'x');
}

}  // namespace

Symmetry detectSymmetry(const Surface& surface, double tolerance) {
  Symmetry symmetry;
  if (surface.size() < MIN_POINTS) return symmetry;
  const SelfMatch shape(surface);
  const auto axes = possibleAxes(principalOf(surface, shape.center()));

  std::vector<Turn> turns = turnsOfOrder(shape, axes, 2, tolerance);
  if (turns.size() == 1 && isRound(shape, turns[0], tolerance)) {
    const Turn& half = turns[0];
    symmetry.center = half.center;
    symmetry.axis = half.axis;
    const Turn over = refined(shape, {half.center, half.axis.unitOrthogonal(), M_PI});
    if (over.misfit <= shape.limit(over.axis, tolerance)) {
      symmetry.center = commonCenter({half, over}, shape.center());
      symmetry.rotations = {rotationAbout(half.axis.unitOrthogonal(), M_PI)};
    }
    return symmetry;
  }
  for (int order = 3; order <= MAX_ORDER; ++order)
    for (const Turn& found : turnsOfOrder(shape, axes, order, tolerance)) turns.push_back(found);
  symmetry.center = commonCenter(turns, shape.center());
  for (const Turn& found : turns)
    for (double angle = found.angle; angle < 2 * M_PI - 0.1; angle += found.angle)
      addUnlessThere(symmetry.rotations, rotationAbout(found.axis, angle));
  closeGroup(symmetry.rotations);
  return symmetry;
}

Eigen::Matrix3d dominantAxes(const Surface& surface) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  for (int round = 0; round < 20; ++round) {
    Eigen::Matrix3d sums = Eigen::Matrix3d::Zero();
    for (const auto& normal : surface.normals) {
      const Eigen::Vector3d along = axes.transpose() * normal.cast<double>();
      int nearest;
      along.cwiseAbs().maxCoeff(&nearest);
      sums.col(nearest) += (along[nearest] < 0 ? -1 : 1) * normal.cast<double>();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sums, Eigen::ComputeFullU | Eigen::ComputeFullV);
    axes = svd.matrixU() * svd.matrixV().transpose();
  }
  return axes;
}

Symmetry declaredSymmetry(const std::string& words, const Eigen::Vector3d& center) {
  static const std::array<std::string, 8> KNOWN{"none",   "axis x", "axis y", "axis z",
                                                "half x", "half y", "half z", "box"};
  if (std::find(KNOWN.begin(), KNOWN.end(), words) == KNOWN.end())
    throw std::invalid_argument(
        "symmetry must be \"none\", \"axis x|y|z\", \"half x|y|z\" or \"box\", got \"" + words +
        "\"");
  Symmetry symmetry;
  symmetry.center = center;
  symmetry.declared = true;
  if (words.rfind("axis", 0) == 0) symmetry.axis = axisByName(words);
  if (words.rfind("half", 0) == 0) symmetry.rotations = {rotationAbout(axisByName(words), M_PI)};
  if (words == "box")
    for (const char* axis : {"x", "y", "z"})
      symmetry.rotations.push_back(rotationAbout(axisByName(axis), M_PI));
  return symmetry;
}

std::vector<Eigen::Isometry3d> symmetryMotions(const Symmetry& symmetry, int steps) {
  if (steps < 1)
    throw std::invalid_argument("steps must be at least 1, got " + std::to_string(steps));
  std::vector<Eigen::Matrix3d> turns{Eigen::Matrix3d::Identity()};
  if (symmetry.continuous())
    for (int k = 1; k < steps; ++k)
      turns.push_back(rotationAbout(symmetry.axis, 2 * M_PI * k / steps));
  std::vector<Eigen::Matrix3d> rotations{Eigen::Matrix3d::Identity()};
  rotations.insert(rotations.end(), symmetry.rotations.begin(), symmetry.rotations.end());

  std::vector<Eigen::Isometry3d> motions;
  for (const auto& rotation : rotations)
    for (const auto& about_axis : turns) {
      Eigen::Isometry3d motion(Eigen::Translation3d(symmetry.center));
      motion.rotate(about_axis * rotation).translate(-symmetry.center);
      motions.push_back(motion);
    }
  return motions;
}

bool samePose(const Symmetry& symmetry, const Eigen::Isometry3d& T_camera_a,
              const Eigen::Isometry3d& T_camera_b, double shift, double turn) {
  if ((T_camera_a * symmetry.center - T_camera_b * symmetry.center).norm() > shift) return false;
  const Eigen::Matrix3d R = T_camera_a.linear().transpose() * T_camera_b.linear();
  const auto isSmall = [&](const Eigen::Matrix3d& rotation) {
    if (symmetry.continuous()) return symmetry.axis.dot(rotation * symmetry.axis) >= std::cos(turn);
    return angleOf(rotation) <= turn;
  };
  return isSmall(R) || std::any_of(symmetry.rotations.begin(), symmetry.rotations.end(),
                                   [&](const Eigen::Matrix3d& turned) {
                                     return isSmall(R * turned.transpose());
                                   });
}

Eigen::Isometry3d canonicalPose(const Symmetry& symmetry, const Eigen::Isometry3d& T_camera_object,
                                const Eigen::Matrix3d& R_camera_reference) {
  std::vector<Eigen::Matrix3d> turns{Eigen::Matrix3d::Identity()};
  turns.insert(turns.end(), symmetry.rotations.begin(), symmetry.rotations.end());
  const Eigen::Matrix3d R_reference_object =
      R_camera_reference.transpose() * T_camera_object.linear();
  Eigen::Matrix3d best = turns.front();
  double most = -std::numeric_limits<double>::infinity();  // the trace falls as the angle grows
  for (auto& turn : turns) {
    if (symmetry.continuous()) {  // trace(R turn spin(angle)) = c + a cos(angle) + b sin(angle)
      const Eigen::Matrix3d R = R_reference_object * turn;
      const Eigen::Vector3d& axis = symmetry.axis;
      const Eigen::Vector3d skew(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
      const double a = R.trace() - axis.dot(R * axis), b = -axis.dot(skew);
      turn = turn * Eigen::AngleAxisd(std::atan2(b, a), axis);
    }
    const double trace = (R_reference_object * turn).trace();
    if (trace <= most) continue;
    most = trace;
    best = turn;
  }
  return T_camera_object * Eigen::Translation3d(symmetry.center) * Eigen::Isometry3d(best) *
         Eigen::Translation3d(-symmetry.center);
}

}  // namespace tabletop_perception
