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
  const auto sides = sidesOf(polygon, margin);
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
    for (const auto& side : sides) {
      const double rest = side.offset - side.inside.y() * y;  // inside.x() * x >= rest
      if (std::abs(side.inside.x()) < 1e-12) {
        if (rest > 0) to = -std::numeric_limits<float>::max();
      } else if (side.inside.x() > 0) {
        from = std::max(from, rest / side.inside.x());
      } else {
        to = std::min(to, rest / side.inside.x());
      }
    }
    slices_.push_back({static_cast<float>(from), static_cast<float>(to)});
  }
}

}  // namespace tabletop_perception
