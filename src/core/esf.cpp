#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include <Eigen/Geometry>

#include "tabletop_perception/descriptor.h"
#include "tabletop_perception/random.h"

namespace tabletop_perception {
namespace {

constexpr int TRIPLES = 5000;
constexpr int BINS = 64;             // of each shape function
constexpr int MAX_CELLS = 64;        // of the grid along its longest side
constexpr float ON_SURFACE = 0.9f;   // least share of a line's cells for one that runs on it
constexpr float OFF_SURFACE = 0.1f;  // and largest for one that runs beside it; its ends touch

/// Whether a line runs on the surface, beside it, or partly on it.
enum Course { ON, OFF, MIXED };

/// Cubes of space that are on the surface: those with a point and those around them.
class SurfaceGrid {
 public:
  SurfaceGrid(const std::vector<Eigen::Vector3f>& points, double spacing) {
    Eigen::AlignedBox3f box;
    for (const auto& p : points) box.extend(p);
    const auto least = box.sizes().maxCoeff() / (MAX_CELLS - 3);
    per_cell_ = 1 / std::max(static_cast<float>(spacing), least);
    origin_ = box.min() - Eigen::Vector3f::Constant(1.5f / per_cell_);
    size_ = (box.sizes() * per_cell_).array().ceil().matrix().cast<int>().array() + 4;
    filled_.assign(static_cast<std::size_t>(size_.prod()), 0);
    for (const auto& p : points) fillAround(cellOf(p));
  }

  /// Share of the cells along a line, its ends left out, that are on the surface.
  float shareOnSurface(const Eigen::Vector3f& from, const Eigen::Vector3f& to) const {
    const Eigen::Vector3f a = (from - origin_) * per_cell_, b = (to - origin_) * per_cell_;
    const Eigen::Vector3f line = b - a;
    const int steps = static_cast<int>(line.cwiseAbs().maxCoeff());
    if (steps < 2) return 1;
    int on = 0;
    const Eigen::Vector3f step = line / static_cast<float>(steps);
    Eigen::Vector3f at = a;
    for (int i = 1; i < steps; ++i) {
      at += step;
      on += filled_[indexOf(at.cast<int>())];
    }
    return static_cast<float>(on) / static_cast<float>(steps - 1);
  }

 private:
  Eigen::Vector3i cellOf(const Eigen::Vector3f& p) const {
    return ((p - origin_) * per_cell_).cast<int>();
  }
  std::size_t indexOf(const Eigen::Vector3i& cell) const {
    return (static_cast<std::size_t>(cell.z()) * size_.y() + cell.y()) * size_.x() + cell.x();
  }
  void fillAround(const Eigen::Vector3i& cell) {
    for (int z = -1; z <= 1; ++z)
      for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) filled_[indexOf(cell + Eigen::Vector3i(x, y, z))] = 1;
  }

  Eigen::Vector3f origin_;
  float per_cell_;
  Eigen::Vector3i size_;
  std::vector<std::uint8_t> filled_;
};

Course courseOf(float share) {
  if (share >= ON_SURFACE) return ON;
  return share <= OFF_SURFACE ? OFF : MIXED;
}

/// Of the three lines of a triangle.
Course courseOf(const std::array<float, 3>& shares) {
  const Course first = courseOf(shares[0]);
  return first == courseOf(shares[1]) && first == courseOf(shares[2]) ? first : MIXED;
}

int binOf(float share) { return std::clamp(static_cast<int>(share * BINS), 0, BINS - 1); }

/// Counts of the shape functions, each BINS long, in the order of the vector.
struct ShapeFunctions {
  std::array<std::array<float, BINS>, 3> angle{}, area{}, distance{};  // by course
  std::array<float, BINS> ratio{};

  void count(const std::array<Eigen::Vector3f, 3>& corners, const SurfaceGrid& grid,
             float diameter) {
    std::array<float, 3> lengths, shares;  // of the side across from each corner
    for (int i = 0; i < 3; ++i) {
      const auto &a = corners[(i + 1) % 3], &b = corners[(i + 2) % 3];
      lengths[i] = (b - a).norm();
      shares[i] = grid.shareOnSurface(a, b);
      const Course course = courseOf(shares[i]);
      ++distance[course][binOf(lengths[i] / diameter)];
      if (course == MIXED) ++ratio[binOf(shares[i])];
    }
    const Eigen::Vector3f ab = corners[1] - corners[0], ac = corners[2] - corners[0];
    const float twice_area = ab.cross(ac).norm();
    const float corner = std::atan2(twice_area, ab.dot(ac));
    ++angle[courseOf(shares[0])][binOf(corner / static_cast<float>(M_PI))];
    // The largest triangle between points so far apart is equilateral: 0.433 of the square.
    ++area[courseOf(shares)][binOf(std::sqrt(twice_area / 0.866f) / diameter)];
  }

  std::vector<float> values() const {
    std::vector<float> all;
    for (const auto* group : {&angle, &area, &distance}) append(group->data(), 3, all);
    append(&ratio, 1, all);
    return all;
  }

 private:
  /// Shape functions that sum to 100 together.
  static void append(const std::array<float, BINS>* group, int count, std::vector<float>& all) {
    float sum = 0;
    for (int i = 0; i < count; ++i)
      for (const float value : group[i]) sum += value;
    for (int i = 0; i < count; ++i)
      for (const float value : group[i]) all.push_back(sum > 0 ? 100 * value / sum : 0);
  }
};

}  // namespace

Descriptor computeEsf(const Surface& surface, double spacing) {
  const auto& points = surface.points;
  if (points.size() < 3) throw std::invalid_argument("esf: the surface has under three points");
  const Eigen::Vector3f centroid = centroidOf(points);
  const float diameter = std::max(static_cast<float>(extentOf(points)), 1e-6f);
  const SurfaceGrid grid(points, spacing);
  Random random(1);
  ShapeFunctions functions;
  for (int i = 0; i < TRIPLES; ++i) {
    const auto pick = [&] { return points[random.index(points.size())]; };
    const Eigen::Vector3f a = pick(), b = pick(), c = pick();
    functions.count({a, b, c}, grid, diameter);
  }
  return {"esf", functions.values(), centroid, std::nullopt};
}

}  // namespace tabletop_perception
