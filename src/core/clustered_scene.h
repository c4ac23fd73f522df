#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "marks.h"
#include "tabletop_perception/cloud.h"
#include "tabletop_perception/geometry.h"
#include "tabletop_perception/model_index.h"
#include "tabletop_perception/planar_surface.h"

namespace tabletop_perception {

/// Sampled points of some clusters, in smooth parts.
struct Parts {
  std::vector<Surface> surfaces;
  std::vector<PlanarSurface> planar;  ///< the same, for kernels

  void add(Surface part);
};

/// The clusters of a scene in samples, and which of these a model at a pose explains. Refers to
/// what it is made of, which must outlive it. Clusters are counted from 0; their label in the
/// segmentation is 2 more. Points are in the camera's frame [m].
class ClusteredScene {
 public:
  ClusteredScene(const Cloud& scene, const std::vector<Indices>& clusters, const ModelIndex& index);

  std::size_t clusters() const { return clusters_.size(); }
  const Indices& cluster(std::size_t cluster) const { return clusters_[cluster]; }
  const std::vector<Surface>& parts() const { return parts_.surfaces; }

  /// The parts of the clusters with these labels.
  Parts partsOf(const std::vector<std::uint32_t>& labels) const;

  /// Those of them that are not marked.
  Parts restOf(const std::vector<std::uint32_t>& labels, const Marks& marks) const;

  /// The parts of all clusters that may show a model at a pose.
  Parts partsAbout(int model, const Eigen::Isometry3d& T_camera_object) const;

  /// The points that a model at a pose explains.
  Marks explainedBy(int model, const Eigen::Isometry3d& T_camera_object, double tolerance) const;

  /// Share of a cluster's samples that is marked.
  double shareOf(const Marks& marks, std::size_t cluster) const;

  std::vector<Eigen::Vector3f> markedPoints(const Marks& marks) const;

  /// The points, not sampled, of all clusters in which any is marked.
  std::vector<Eigen::Vector3f> pointsOfClusters(const Marks& marks) const;

  /// The samples near a model, whichever way they face, of all clusters in which any is marked.
  Surface samplesAround(int model, const Eigen::Isometry3d& T_camera_object,
                        const Marks& marks) const;

  /// The points of a cluster, not sampled, within `tolerance` of a model.
  std::vector<Eigen::Vector3f> pointsNear(int model, const Eigen::Isometry3d& T_camera_object,
                                          std::size_t cluster, double tolerance) const;

  /// The points near a model that face as it does: what ICP is to lay it on.
  Surface sourceFor(int model, const Eigen::Isometry3d& T_camera_object, const Parts& parts) const;

 private:
  const Cloud& scene_;
  const std::vector<Indices>& clusters_;
  const ModelIndex& index_;
  Parts parts_;                       ///< of the clusters, one after the other
  std::vector<int> cluster_of_part_;  ///< index of the cluster
};

}  // namespace tabletop_perception
