#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "point_bins.h"
#include "tabletop_perception/descriptor.h"

namespace tabletop_perception {
namespace {

constexpr int OUR_VIEW_BINS = 64;
constexpr int OCTANT_BINS = 13;
constexpr float OCTANT_BIN = 0.02f;   // [m]; 13 of them hold objects of up to 50 cm
constexpr float OCTANT_BLUR = 0.01f;  // points this near to a plane of the frame count half [m]
constexpr float ROUND = 0.8f;         // ratio of a region's width and length that tells no longest
                                      // direction
constexpr float EVEN = 0.85f;         // ratio of what lies to both sides that tells no fuller one

/// The scatter of a region about its centroid, points in the middle weighing most.
Eigen::Matrix3f weightedScatter(const Surface& region, const Eigen::Vector3f& centroid) {
  float farthest = 0;
  for (const auto& p : region.points) farthest = std::max(farthest, (p - centroid).norm());
  Eigen::Matrix3f scatter = Eigen::Matrix3f::Zero();
  for (const auto& p : region.points) {
    const Eigen::Vector3f offset = p - centroid;
    scatter += (farthest - offset.norm()) * offset * offset.transpose();
  }
  return scatter;
}

/// 1 where more of the surface lies to the side of `axis`, -1 where less, 0 where that is not
/// clear.
int fullerSide(const Surface& surface, const Eigen::Vector3f& centroid,
               const Eigen::Vector3f& axis) {
  float before = 0, behind = 0;
  for (const auto& p : surface.points) {
    const float along = axis.dot(p - centroid);
    (along > 0 ? before : behind) += std::abs(along);
  }
  if (std::min(before, behind) > EVEN * std::max(before, behind)) return 0;
  return before > behind ? 1 : -1;
}

/// The reference frames of a region: one or, where the surface leaves a choice, two or four.
std::vector<Eigen::Matrix3f> framesOf(const Surface& surface, const Surface& region,
                                      const Eigen::Vector3f& centroid) {
  const Eigen::Vector3f z = meanNormal(region);
  const Eigen::Vector3f u = z.unitOrthogonal(), v = z.cross(u);
  Eigen::Matrix<float, 3, 2> plane;
  plane << u, v;
  const Eigen::Matrix2f across = plane.transpose() * weightedScatter(region, centroid) * plane;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2f> solver(across);
  const float length = std::sqrt(std::max(0.0f, solver.eigenvalues()[1]));
  const float width = std::sqrt(std::max(0.0f, solver.eigenvalues()[0]));
  const Eigen::Vector3f longest = (plane * solver.eigenvectors().col(1)).normalized();

  std::vector<Eigen::Vector3f> directions{longest};
  if (width > ROUND * length) directions.push_back(z.cross(longest));
  std::vector<Eigen::Matrix3f> frames;
  for (const auto& direction : directions) {
    const int side = fullerSide(surface, centroid, direction);
    for (const int sign : {1, -1}) {
      if (side == -sign) continue;
      Eigen::Matrix3f axes;
      axes.col(0) = static_cast<float>(sign) * direction;
      axes.col(2) = z;
      axes.col(1) = z.cross(axes.col(0));
      frames.push_back(axes);
    }
  }
  return frames;
}

/// Distances of the points from the centroid by octants of the frame. A point near a plane of the
/// frame counts to both sides, and to the two nearest bins, so that small turns change little.
std::vector<float> octantsOf(const Surface& surface, const Eigen::Vector3f& centroid,
                             const Eigen::Matrix3f& axes) {
  std::vector<float> bins(8 * OCTANT_BINS, 0.0f);
  const float share = 100.0f / static_cast<float>(surface.size());
  for (const auto& p : surface.points) {
    const Eigen::Vector3f q = axes.transpose() * (p - centroid);
    std::array<std::array<float, 2>, 3> sides;  // per axis: of the negative side, the positive
    for (int axis = 0; axis < 3; ++axis) {
      const float blur = q[axis] / OCTANT_BLUR;
      const float other = 0.5f * std::exp(-blur * blur);
      sides[axis] = q[axis] < 0 ? std::array<float, 2>{1 - other, other}
                                : std::array<float, 2>{other, 1 - other};
    }
    const float at = std::clamp(q.norm() / OCTANT_BIN - 0.5f, 0.0f, OCTANT_BINS - 1.0f);
    const int low = std::min(static_cast<int>(at), OCTANT_BINS - 2);
    const float high_share = at - static_cast<float>(low);
    for (int octant = 0; octant < 8; ++octant) {
      const float weight =
          share * sides[0][octant & 1] * sides[1][octant >> 1 & 1] * sides[2][octant >> 2];
      bins[octant * OCTANT_BINS + low] += weight * (1 - high_share);
      bins[octant * OCTANT_BINS + low + 1] += weight * high_share;
    }
  }
  return bins;
}

}  // namespace

std::vector<Descriptor> computeOurCvfh(const Surface& surface,
                                       const std::vector<std::vector<int>>& regions,
                                       const Eigen::Vector3f& viewpoint) {
  std::vector<Descriptor> descriptors;
  if (regions.empty()) return descriptors;
  const Eigen::Vector3f whole = centroidOf(surface.points);
  const PlanarSurface planar(surface);
  for (const auto& indices : regions) {
    const Surface region = selected(surface, indices);
    const Eigen::Vector3f centroid = centroidOf(region.points);
    const PointBins bins(planar,
                         {centroid, meanNormal(region), (viewpoint - centroid).normalized()},
                         {SHAPE_BINS, OUR_VIEW_BINS, 1.0f});
    for (const auto& axes : framesOf(surface, region, centroid)) {
      Descriptor descriptor{"our_cvfh", {}, whole, axes};
      const auto octants = octantsOf(surface, centroid, axes);
      for (const auto* block : {&bins.alpha, &bins.phi, &bins.theta, &octants, &bins.view})
        descriptor.values.insert(descriptor.values.end(), block->begin(), block->end());
      descriptors.push_back(std::move(descriptor));
    }
  }
  return descriptors;
}

}  // namespace tabletop_perception
