#include "convex_hull.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <opencv2/imgproc.hpp>

namespace tabletop_perception {
namespace {

constexpr double SLICE = 0.002;  // [m]
constexpr int MAX_SLICES = 4096;

double signedArea(const std::vector<Eigen::Vector2d>& polygon) {
  double area = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto& a = polygon[i];
    const auto& b = polygon[(i + 1) % polygon.size()];
    area += (a.x() * b.y() - b.x() * a.y()) / 2;
  }
  return area;
}

/// A half-plane: points p with inside.dot(p) >= offset.
struct Side {
  Eigen::Vector2d inside;
  double offset;
};

std::vector<Side> sidesOf(const std::vector<Eigen::Vector2d>& polygon, double margin) {
  std::vector<Side> sides;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d edge = polygon[(i + 1) % polygon.size()] - polygon[i];
    if (edge.norm() < 1e-12) continue;
    const Eigen::Vector2d inside = Eigen::Vector2d(-edge.y(), edge.x()).normalized();
    sides.push_back({inside, inside.dot(polygon[i]) - margin});
  }
  return sides;
}

}  // namespace

std::vector<Eigen::Vector2d> convexHullOf(const std::vector<Eigen::Vector2f>& points) {
  std::vector<cv::Point2f> all, corners;
  for (const auto& p : points) all.emplace_back(p.x(), p.y());
  if (all.size() < 3) return {};
  cv::convexHull(all, corners);
  std::vector<Eigen::Vector2d> hull;
  for (const auto& corner : corners) hull.emplace_back(corner.x, corner.y);
  const double area = signedArea(hull);
  if (std::abs(area) < 1e-9) return {};
  if (area < 0) std::reverse(hull.begin(), hull.end());
  return hull;
}

Eigen::Vector2d centroidOfPolygon(const std::vector<Eigen::Vector2d>& polygon) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto& a = polygon[i];
    const auto& b = polygon[(i + 1) % polygon.size()];
    sum += (a.x() * b.y() - b.x() * a.y()) * (a + b);
  }
  return sum / (6 * signedArea(polygon));
}

ConvexRegion::ConvexRegion(const std::vector<Eigen::Vector2d>& polygon, double margin) {
  if (polygon.empty()) return;
  struct Bound {
    double at_zero, slope;  // x along y
  };
  std::vector<Bound> lower, upper;
  double lowest = -std::numeric_limits<double>::infinity(), highest = -lowest;  // of y
  for (const auto& [inside, offset] : sidesOf(polygon, margin)) {  // inside * p >= offset
    if (std::abs(inside.x()) >= 1e-12)
      (inside.x() > 0 ? lower : upper).push_back({offset / inside.x(), -inside.y() / inside.x()});
    else if (inside.y() > 0)
      lowest = std::max(lowest, offset / inside.y());
    else
      highest = std::min(highest, offset / inside.y());
  }
  double low = std::numeric_limits<double>::max(), high = -low;
  for (const auto& p : polygon) {
    low = std::min(low, p.y() - margin);
    high = std::max(high, p.y() + margin);
  }
  if (!(high > low)) return;
  const int count = std::clamp(static_cast<int>(std::ceil((high - low) / SLICE)), 1, MAX_SLICES);
  low_ = static_cast<float>(low);
  slices_per_metre_ = static_cast<float>(count / (high - low));
  for (int i = 0; i < count; ++i) {
    const double y = low + (i + 0.5) * (high - low) / count;
    double from = -std::numeric_limits<float>::max(), to = -from;
    for (const auto& bound : lower) from = std::max(from, bound.at_zero + bound.slope * y);
    for (const auto& bound : upper) to = std::min(to, bound.at_zero + bound.slope * y);
    if (y < lowest || y > highest) to = -std::numeric_limits<float>::max();
    slices_.push_back({static_cast<float>(from), static_cast<float>(to)});
  }
}

}  // namespace tabletop_perception
