#include "main_plane.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <random>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "plane_fit.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t SAMPLE_SIZE = 1500;  // points that planes are counted over
constexpr int DRAWS = 8;
constexpr int CLIMBS = 3;  // from the best of the draws
constexpr std::uint32_t SEED = 1;
constexpr int REWEIGHTINGS = 10;
constexpr double LEAST_ERROR = 5e-4;  // that weighs less than any larger one [m]

struct CountedPlane {
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();
  std::size_t near = 0;

  void offer(const Cloud& points, const Eigen::Vector4d& other, double distance) {
    const std::size_t count = countNearPlane(points, other, distance);
    if (count > near) *this = {other, count};
  }
};

/// The plane turned about a point by an angle about an axis [rad], and shifted along its normal.
Eigen::Vector4d moved(const Eigen::Vector3d& normal, const Eigen::Vector3d& about, double shift) {
  Eigen::Vector4d plane;
  plane << normal, -normal.dot(about) - shift;
  return plane;
}

/// The best plane that is reached by turns and shifts that gain points each, large ones first.
CountedPlane climbed(const Cloud& points, CountedPlane best, double distance) {
  for (const double turn_deg : {8.0, 4.0, 2.0, 1.0}) {
    for (std::size_t before = 0; before < best.near;) {
      before = best.near;
      const auto fit = fitPlaneNear(points, best.plane, distance);
      if (!fit) return best;
      const Eigen::Vector3d normal = best.plane.head<3>(), u = normal.unitOrthogonal(),
                            v = normal.cross(u);
      const double turn = turn_deg * M_PI / 180;
      for (const Eigen::Vector3d& aside :
           {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(turn * u), Eigen::Vector3d(-turn * u),
            Eigen::Vector3d(turn * v), Eigen::Vector3d(-turn * v)})
        for (const double shift : {-0.4, -0.2, -0.1, 0.0, 0.1, 0.2, 0.4})
          best.offer(points, moved((normal + aside).normalized(), fit->centroid, shift * distance),
                     distance);
    }
  }
  return best;
}

/// The plane of least absolute distances from the points within `distance` of a plane: a strip of
/// another face, which lies as near, turns it less than that of least squares.
Eigen::Vector4d leastAbsolute(const Cloud& points, const Eigen::Vector4d& near, double distance) {
  std::vector<Eigen::Vector3d> inliers;
  for (const int i : pointsNearPlane(points, near, distance))
    inliers.push_back(points.point(i).cast<double>());
  Eigen::Vector4d plane = near;
  for (int round = 0; round < REWEIGHTINGS; ++round) {
    double sum = 0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
    for (const auto& p : inliers) {
      const double off = std::abs(plane.head<3>().dot(p) + plane[3]);
      const double weight = round == 0 ? 1 : 1 / std::max(LEAST_ERROR, off);
      const Eigen::Vector3d d = p - inliers.front();
      sum += weight;
      mean += weight * d;
      products += weight * d * d.transpose();
    }
    mean /= sum;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(products / sum -
                                                                mean * mean.transpose());
    const Eigen::Vector3d normal = solver.eigenvectors().col(0);
    plane << normal, -normal.dot(mean + inliers.front());
  }
  return plane;
}

}  // namespace

std::optional<Eigen::Vector4d> mainPlane(const Cloud& thing, double distance) {
  const Cloud points = samplePoints(thing, SAMPLE_SIZE);
  std::mt19937 random(SEED);
  std::vector<CountedPlane> starts;
  for (int i = 0; i < DRAWS; ++i) {
    const auto drawn = drawPlane(points, distance, std::nullopt, random);
    if (!drawn) return std::nullopt;
    starts.emplace_back().offer(points, *drawn, distance);
  }
  std::stable_sort(starts.begin(), starts.end(),
                   [](const auto& a, const auto& b) { return a.near > b.near; });
  CountedPlane best;
  for (int i = 0; i < CLIMBS; ++i) {
    const auto reached = climbed(points, starts[i], distance);
    if (reached.near > best.near) best = reached;
  }
  return leastAbsolute(points, best.plane, distance);
}

}  // namespace tabletop_perception
