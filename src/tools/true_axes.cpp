#include "true_axes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

namespace tabletop_perception::tools {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr std::size_t TRIED_POINTS = 1500;     // that all planes are counted over
constexpr double LIKELY = 0.95, ALIKE = 0.98;  // shares of the best plane's points
constexpr double OFFSET_STEP = 0.0005;         // between tried planes of one normal [m]
constexpr double COARSE_STEP = 3 * M_PI / 180, FINE_STEP = M_PI / 180;  // between tried normals
constexpr int FINE_STEPS = 3;                                           // to either side
constexpr int REWEIGHTINGS = 30;      // of the fit by least absolute distances
constexpr double LEAST_ERROR = 2e-4;  // that weighs less than any larger one [m]

struct TriedPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double offset = 0;  ///< of the plane along its normal [m]
  int near = 0;       ///< tried points within TrueAxes::DISTANCE
};

/// The plane across a normal that holds most points.
TriedPlane bestAcross(const Eigen::Vector3d& normal, const Points& points,
                      std::vector<int>& histogram) {
  constexpr int BAND = static_cast<int>(2 * TrueAxes::DISTANCE / OFFSET_STEP + 0.5);
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const auto& p : points) {
    const double offset = normal.dot(p);
    low = std::min(low, offset);
    high = std::max(high, offset);
  }
  histogram.assign(static_cast<std::size_t>((high - low) / OFFSET_STEP) + 1 + BAND, 0);
  for (const auto& p : points)
    ++histogram[static_cast<std::size_t>((normal.dot(p) - low) / OFFSET_STEP)];
  TriedPlane best;
  best.normal = normal;
  int near = 0;
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    near += histogram[i];
    if (i >= BAND) near -= histogram[i - BAND];
    if (near <= best.near) continue;
    best.near = near;
    best.offset = low + (static_cast<double>(i) + 1 - BAND / 2.0) * OFFSET_STEP;
  }
  return best;
}

/// Directions over half a sphere.
Points directions() {
  Points all;
  for (double tilt = 0; tilt <= M_PI / 2; tilt += COARSE_STEP) {
    const int count = std::max(1, static_cast<int>(2 * M_PI * std::sin(tilt) / COARSE_STEP));
    for (int k = 0; k < count; ++k) {
      const double turn = 2 * M_PI * k / count;
      all.emplace_back(std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn),
                       std::cos(tilt));
    }
  }
  return all;
}

/// Keeps those that hold at least `share` of what the best one does, the best one first.
void keepAlike(std::vector<TriedPlane>& planes, double share) {
  std::stable_sort(planes.begin(), planes.end(),
                   [](const TriedPlane& a, const TriedPlane& b) { return a.near > b.near; });
  while (!planes.empty() && planes.back().near < share * planes.front().near) planes.pop_back();
}

/// The best of the planes that are turned a little from one.
TriedPlane refined(const TriedPlane& plane, const Points& points, std::vector<int>& histogram) {
  TriedPlane best;
  const Eigen::Vector3d middle = plane.normal, u = middle.unitOrthogonal(), v = middle.cross(u);
  for (int i = -FINE_STEPS; i <= FINE_STEPS; ++i)
    for (int j = -FINE_STEPS; j <= FINE_STEPS; ++j) {
      const Eigen::Vector3d normal = (middle + FINE_STEP * (i * u + j * v)).normalized();
      const TriedPlane tried = bestAcross(normal, points, histogram);
      if (tried.near > best.near) best = tried;
    }
  return best;
}

/// The planes that hold most points and, to within LIKELY and then ALIKE, as many; the first most.
std::vector<TriedPlane> bestPlanes(const Points& points) {
  Points few;
  const double step =
      std::max(1.0, static_cast<double>(points.size()) / static_cast<double>(TRIED_POINTS));
  for (double i = 0; i < static_cast<double>(points.size()); i += step)
    few.push_back(points[static_cast<std::size_t>(i)]);

  std::vector<int> histogram;
  std::vector<TriedPlane> planes;
  for (const auto& normal : directions()) planes.push_back(bestAcross(normal, few, histogram));
  keepAlike(planes, LIKELY);
  for (auto& plane : planes) plane = refined(plane, points, histogram);
  keepAlike(planes, ALIKE);
  return planes;
}

Points within(const Points& points, const TriedPlane& plane) {
  Points near;
  for (const auto& p : points)
    if (std::abs(plane.normal.dot(p) - plane.offset) <= TrueAxes::DISTANCE) near.push_back(p);
  return near;
}

/// Normal of the plane with the least sum of absolute distances: a strip of another face, which the
/// band holds too, does not turn it as it turns that of least squares.
Eigen::Vector3d normalOf(const Points& points) {
  std::vector<double> weights(points.size(), 1);
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  for (int round = 0; round < REWEIGHTINGS; ++round) {
    double sum = 0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      sum += weights[i];
      mean += weights[i] * points[i];
    }
    mean /= sum;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d d = points[i] - mean;
      spread += weights[i] * d * d.transpose();
    }
    normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
    for (std::size_t i = 0; i < points.size(); ++i)
      weights[i] = 1 / std::max(LEAST_ERROR, std::abs(normal.dot(points[i] - mean)));
  }
  return normal;
}

std::optional<Eigen::Vector3d> longerSide(const Points& points, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d u = normal.unitOrthogonal(), v = normal.cross(u);
  std::vector<cv::Point2f> flat;
  for (const auto& p : points)
    flat.emplace_back(static_cast<float>(u.dot(p)), static_cast<float>(v.dot(p)));
  std::array<cv::Point2f, 4> corners;
  cv::minAreaRect(flat).points(corners.data());
  const cv::Point2f a = corners[1] - corners[0], b = corners[2] - corners[1];
  const double length_a = std::hypot(a.x, a.y), length_b = std::hypot(b.x, b.y);

  if (std::max(length_a, length_b) < TrueAxes::MIN_ELONGATION * std::min(length_a, length_b))
    return std::nullopt;
  const cv::Point2f longer = length_a > length_b ? a : b;
  return Eigen::Vector3d((longer.x * u + longer.y * v).normalized());
}

}  // namespace

TrueAxes trueAxesOf(const std::vector<Eigen::Vector3f>& surface) {
  TrueAxes axes;
  Points points;
  for (const auto& p : surface) points.push_back(p.cast<double>());
  const auto planes = points.empty() ? std::vector<TriedPlane>() : bestPlanes(points);
  if (planes.empty() || static_cast<double>(planes.front().near) <
                            TrueAxes::MIN_SHARE * static_cast<double>(points.size()))
    return axes;
  for (const auto& plane : planes) axes.z.push_back(normalOf(within(points, plane)));
  axes.x = longerSide(within(points, planes.front()), axes.z.front());
  return axes;
}

}  // namespace tabletop_perception::tools
