#include "main_plane.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "plane_fit.h"
#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t SAMPLE_SIZE = 1000;  // points that planes are counted over
constexpr std::size_t LANES = 8;           // points that a kernel takes at once
constexpr int DRAWS = 8;
constexpr int CLIMBS = 3;  // from the best of the draws
constexpr std::uint32_t SEED = 1;
constexpr int REWEIGHTINGS = 10;
constexpr float LEAST_ERROR = 5e-4f;  // that weighs less than any larger one [m]

/// Shifts of a plane along its normal that are tried, shares of the distance.
constexpr std::array<double, 7> SHARES = {-0.4, -0.2, -0.1, 0, 0.1, 0.2, 0.4};
constexpr std::size_t SHIFTS = SHARES.size();

void padToLanes(Cloud& cloud, float value) {
  const std::size_t padded = (cloud.size() + LANES - 1) / LANES * LANES;
  for (auto* values : {&cloud.x, &cloud.y, &cloud.z}) values->resize(padded, value);
  cloud.width = static_cast<int>(padded);
}

/// Counts the points that lie within `distance` of each of the planes that a shift along its normal
/// makes of one. `count` is a multiple of LANES.
TABLETOP_SIMD_CLONES
void countNearShifted(const float* x, const float* y, const float* z, std::size_t count,
                      const float* plane, const float* shifts, float distance, int* near) {
  const float a = plane[0], b = plane[1], c = plane[2], d = plane[3];
  int lanes[SHIFTS][LANES] = {};
  for (std::size_t i = 0; i < count; i += LANES)
    for (std::size_t l = 0; l < LANES; ++l) {
      const float off = a * x[i + l] + b * y[i + l] + c * z[i + l] + d;
      for (std::size_t k = 0; k < SHIFTS; ++k)
        lanes[k][l] += std::abs(off - shifts[k]) <= distance ? 1 : 0;  // not for NaN
    }
  for (std::size_t k = 0; k < SHIFTS; ++k) near[k] = std::accumulate(lanes[k], lanes[k] + LANES, 0);
}

struct CountedPlane {
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();
  int near = 0;
};

/// Some of a thing's points. The arrays go on to a multiple of LANES with points that are none.
struct Sample {
  Cloud points;
  double distance;  ///< that points of a plane lie within [m]

  Sample(const Cloud& thing, double distance)
      : points(samplePoints(thing, SAMPLE_SIZE)), distance(distance) {
    padToLanes(points, std::numeric_limits<float>::quiet_NaN());
  }

  /// Of `best` and a plane through a point, at any of the shifts, the one near most points.
  void offer(const Eigen::Vector3d& normal, const Eigen::Vector3d& through,
             CountedPlane& best) const {
    Eigen::Vector4d plane;
    plane << normal, -normal.dot(through);
    const Eigen::Vector4f kernel_plane = plane.cast<float>();
    std::array<float, SHIFTS> shifts;
    for (std::size_t k = 0; k < SHIFTS; ++k) shifts[k] = static_cast<float>(SHARES[k] * distance);
    std::array<int, SHIFTS> near;
    countNearShifted(points.x.data(), points.y.data(), points.z.data(), points.size(),
                     kernel_plane.data(), shifts.data(), static_cast<float>(distance), near.data());
    const auto most = std::max_element(near.begin(), near.end());
    if (*most <= best.near) return;
    best.near = *most;
    best.plane = plane;
    best.plane[3] -= SHARES[most - near.begin()] * distance;
  }
};

/// The best plane that is reached by turns and shifts that gain points each, large ones first.
CountedPlane climbed(const Sample& sample, CountedPlane best) {
  for (const double turn_deg : {8.0, 4.0, 2.0, 1.0}) {
    for (int before = -1; before < best.near;) {
      before = best.near;
      const auto fit = fitPlaneNear(sample.points, best.plane, sample.distance);
      if (!fit) return best;
      const Eigen::Vector3d normal = best.plane.head<3>(), u = normal.unitOrthogonal(),
                            v = normal.cross(u);
      const double turn = turn_deg * M_PI / 180;
      for (const Eigen::Vector3d& aside :
           {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(turn * u), Eigen::Vector3d(-turn * u),
            Eigen::Vector3d(turn * v), Eigen::Vector3d(-turn * v)})
        sample.offer((normal + aside).normalized(), fit->centroid, best);
    }
  }
  return best;
}

constexpr int SUMS = 10;

/// Sums over points, each weighed by one over its distance from a plane, or over `least_error` if
/// it is nearer: 1, x y z, xx xy xz yy yz zz. The arrays go on to a multiple of LANES.
TABLETOP_SIMD_CLONES
void addWeighted(const float* x, const float* y, const float* z, std::size_t count,
                 const float* plane, float least_error, float* sums) {
  const float a = plane[0], b = plane[1], c = plane[2], d = plane[3];
  float lanes[SUMS][LANES] = {};
  for (std::size_t i = 0; i < count; i += LANES)
    for (std::size_t l = 0; l < LANES; ++l) {
      const float px = x[i + l], py = y[i + l], pz = z[i + l];
      const float off = std::abs(a * px + b * py + c * pz + d);
      const float weight = zeroUnless(i + l < count, 1 / (off > least_error ? off : least_error));
      const float wx = weight * px, wy = weight * py, wz = weight * pz;
      lanes[0][l] += weight;
      lanes[1][l] += wx;
      lanes[2][l] += wy;
      lanes[3][l] += wz;
      lanes[4][l] += wx * px;
      lanes[5][l] += wx * py;
      lanes[6][l] += wx * pz;
      lanes[7][l] += wy * py;
      lanes[8][l] += wy * pz;
      lanes[9][l] += wz * pz;
    }
  for (int k = 0; k < SUMS; ++k) {
    sums[k] = 0;
    for (const float lane : lanes[k]) sums[k] += lane;
  }
}

/// The plane of least absolute distances from the points within `distance` of a plane: a strip of
/// another face, which lies as near, turns it less than that of least squares.
Eigen::Vector4d leastAbsolute(const Cloud& points, const Eigen::Vector4d& near, double distance) {
  Cloud inliers = selectPositions(points, pointsNearPlane(points, near, distance));
  // About one of them: products stay small in single precision.
  const Eigen::Vector3d origin = inliers.point(0).cast<double>();
  const std::size_t count = inliers.size();
  for (std::size_t i = 0; i < count; ++i)
    inliers.setPoint(i, inliers.point(i) - origin.cast<float>());
  padToLanes(inliers, 0);
  Eigen::Vector4d plane = near;
  plane[3] += near.head<3>().dot(origin);
  for (int round = 0; round < REWEIGHTINGS; ++round) {
    const Eigen::Vector4f weighing = plane.cast<float>();
    float s[SUMS];
    addWeighted(inliers.x.data(), inliers.y.data(), inliers.z.data(), count, weighing.data(),
                round == 0 ? static_cast<float>(distance) : LEAST_ERROR, s);
    const Eigen::Vector3d mean = Eigen::Vector3d(s[1], s[2], s[3]) / s[0];
    Eigen::Matrix3d products;
    products << s[4], s[5], s[6], s[5], s[7], s[8], s[6], s[8], s[9];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(products / s[0] -
                                                                mean * mean.transpose());
    const Eigen::Vector3d normal = solver.eigenvectors().col(0);
    plane << normal, -normal.dot(mean);
  }
  plane[3] -= plane.head<3>().dot(origin);
  return plane;
}

}  // namespace

std::optional<Eigen::Vector4d> mainPlane(const Cloud& thing, double distance) {
  const Sample sample(thing, distance);
  std::mt19937 random(SEED);
  std::vector<CountedPlane> starts;
  for (int i = 0; i < DRAWS; ++i) {
    const auto drawn = drawPlane(sample.points, distance, std::nullopt, random);
    if (!drawn) return std::nullopt;
    starts.push_back({*drawn, static_cast<int>(countNearPlane(sample.points, *drawn, distance))});
  }
  std::stable_sort(starts.begin(), starts.end(),
                   [](const auto& a, const auto& b) { return a.near > b.near; });
  CountedPlane best;
  for (int i = 0; i < CLIMBS; ++i) {
    auto reached = climbed(sample, starts[i]);
    // Two faces may be of nearly one size: a sample does not tell them apart.
    reached.near = static_cast<int>(countNearPlane(thing, reached.plane, distance));
    if (reached.near > best.near) best = reached;
  }
  return leastAbsolute(sample.points, best.plane, distance);
}

}  // namespace tabletop_perception
