#include "tabletop_perception/proposal_memory.h"

#include <algorithm>
#include <utility>

namespace tabletop_perception {
namespace {

constexpr double MAX_COUNT_CHANGE = 0.1;   // of the points
constexpr double MAX_SHIFT = 0.005;        // of the centroid [m]
constexpr double MAX_SPREAD_CHANGE = 0.1;  // of the covariance, by norms

}  // namespace

ClusterShape shapeOf(const Cloud& cloud, const std::vector<Indices>& clusters,
                     const std::vector<int>& members) {
  ClusterShape shape;
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const int k : members) {
    shape.points += clusters[k].size();
    for (const int i : clusters[k]) {
      const Eigen::Vector3d p = cloud.point(i).cast<double>();
      shape.centroid += p;
      squares += p * p.transpose();
    }
  }
  if (shape.points == 0) return shape;
  const auto count = static_cast<double>(shape.points);
  shape.centroid /= count;
  shape.covariance = squares / count - shape.centroid * shape.centroid.transpose();
  return shape;
}

bool staysAs(const ClusterShape& before, const ClusterShape& now) {
  const auto points = static_cast<double>(before.points);
  return std::abs(static_cast<double>(now.points) - points) <= MAX_COUNT_CHANGE * points &&
         (now.centroid - before.centroid).norm() <= MAX_SHIFT &&
         (now.covariance - before.covariance).norm() <=
             MAX_SPREAD_CHANGE * before.covariance.norm();
}

const ProposalMemory::Entry* ProposalMemory::find(const ClusterShape& shape) const {
  const auto found = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& entry) { return staysAs(entry.shape, shape); });
  return found == entries_.end() ? nullptr : &*found;
}

const Found<std::vector<Candidate>>* ProposalMemory::recall(double stamp, const ClusterShape& shape,
                                                            double keep) const {
  const Entry* entry = find(shape);
  const bool fresh = entry && stamp >= entry->matched && stamp - entry->matched < keep;
  return fresh ? &entry->candidates : nullptr;
}

void ProposalMemory::remember(double stamp, const std::vector<ClusterShape>& shapes,
                              const std::vector<Proposal>& proposals,
                              const std::vector<bool>& recalled) {
  std::vector<Entry> entries;
  for (std::size_t k = 0; k < proposals.size(); ++k) {
    const Entry* before = recalled[k] ? find(shapes[k]) : nullptr;
    // The shape stays that of the matching, or a slow thing would move away from its candidates.
    if (before)
      entries.push_back(*before);
    else
      entries.push_back({shapes[k], proposals[k].candidates, stamp});
  }
  entries_ = std::move(entries);
}

}  // namespace tabletop_perception
