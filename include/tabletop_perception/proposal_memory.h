#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/decide.h"

namespace tabletop_perception {

/// What tells whether a cluster is as it was: where its points are, to second order.
struct ClusterShape {
  std::size_t points = 0;
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();    ///< [m]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< [m^2]
};

/// Of the points of some clusters together, by their indices.
ClusterShape shapeOf(const Cloud& cloud, const std::vector<Indices>& clusters,
                     const std::vector<int>& members);

/// Whether a cluster has stayed as it was, up to the noise of a depth camera.
bool staysAs(const ClusterShape& before, const ClusterShape& now);

/// What was proposed for the clusters of the last frame. A cluster that stays as it is may keep its
/// candidates: they are only where ICP starts.
class ProposalMemory {
 public:
  /// The last frame's candidates for a cluster of that shape, matched less than `keep` [s] before
  /// `stamp`; null: there are none. Valid until the next call of another function.
  const Found<std::vector<Candidate>>* recall(double stamp, const ClusterShape& shape,
                                              double keep) const;

  /// Puts the proposals of a frame in place of the last one's. `shapes`: of each; those that were
  /// recalled count as matched when they were.
  void remember(double stamp, const std::vector<ClusterShape>& shapes,
                const std::vector<Proposal>& proposals, const std::vector<bool>& recalled);

  void clear() { entries_.clear(); }

 private:
  struct Entry {
    ClusterShape shape;  ///< when it was matched
    Found<std::vector<Candidate>> candidates;
    double matched;  ///< stamp [s]
  };
  const Entry* find(const ClusterShape& shape) const;

  std::vector<Entry> entries_;
};

}  // namespace tabletop_perception
