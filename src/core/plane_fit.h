#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/planes.h"

namespace tabletop_perception {

/// A plane a x + b y + c z + d = 0 with a unit normal of either sign, and how well it fits.
struct PlaneFit {
  Eigen::Vector4d plane = Eigen::Vector4d::Zero();
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  ///< of the points [m]
  double rms = 0;                                      ///< of the points' distances [m]
  std::size_t points = 0;                              ///< that it was fitted to
};

/// Of how many points of a large cloud one is enough, where all would only take longer.
inline int shareOf(std::size_t points) {
  return std::clamp(static_cast<int>(points / 50000), 1, 6);
}

/// The plane of least squared distances of the points within `band` [m] of `near`; none for fewer
/// than three of them. `share`: only every so manieth group of 8 points is looked at.
std::optional<PlaneFit> fitPlaneNear(const Cloud& cloud, const Eigen::Vector4d& near, double band,
                                     int share = 1);

/// Where the marks, each 0 or 1, are 1.
Indices indicesOf(const std::vector<std::uint8_t>& marks);

/// How many points lie within `distance` [m] of a plane.
std::size_t countNearPlane(const Cloud& cloud, const Eigen::Vector4d& plane, double distance);

/// Points within `distance` [m] of a plane.
Indices pointsNearPlane(const Cloud& cloud, const Eigen::Vector4d& plane, double distance);

/// Points whose signed distance from a plane is from `low` to `high` [m].
Indices pointsBetween(const Cloud& cloud, const Eigen::Vector4d& plane, double low, double high);

/// Appends those of the points from `begin` up to `end`.
void appendBetween(const Cloud& cloud, std::size_t begin, std::size_t end,
                   const Eigen::Vector4d& plane, double low, double high, Indices& between);

/// About `size` of a cloud's valid points (all of them if there are fewer), in its order: one drawn
/// out of each of as many even stretches, the same ones wherever pixels without a point lie
/// between.
Cloud samplePoints(const Cloud& cloud, std::size_t size);

/// The plane within `distance` [m] of most of the points, drawn by RANSAC (Fischler & Bolles 1981);
/// none when no three points span one.
std::optional<Eigen::Vector4d> drawPlane(const Cloud& sample, double distance,
                                         const std::optional<PlaneConstraint>& constraint,
                                         std::mt19937& random);

}  // namespace tabletop_perception
