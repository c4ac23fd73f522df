#pragma once

#include <vector>

#include "tabletop_perception/cloud.h"
#include "tabletop_perception/descriptor.h"
#include "tabletop_perception/planar_surface.h"

namespace tabletop_perception {

/// The sampled points of a scene's clusters, in smooth parts.
struct SceneSamples {
  SceneSamples(const Cloud& scene, const std::vector<Indices>& clusters,
               const DescriptorOptions& options);

  std::vector<Surface> parts;         ///< of the clusters, one after the other
  std::vector<PlanarSurface> planar;  ///< the same, for kernels
  std::vector<int> cluster_of_part;   ///< index of the cluster
};

}  // namespace tabletop_perception
