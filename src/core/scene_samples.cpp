#include "scene_samples.h"

#include <utility>

#include "tabletop_perception/decide.h"

namespace tabletop_perception {

SceneSamples::SceneSamples(const Cloud& scene, const std::vector<Indices>& clusters,
                           const DescriptorOptions& options) {
  for (std::size_t k = 0; k < clusters.size(); ++k)
    for (auto& part : smoothParts(sampleCluster(scene, clusters[k], options), options)) {
      planar.emplace_back(part);
      parts.push_back(std::move(part));
      cluster_of_part.push_back(static_cast<int>(k));
    }
}

}  // namespace tabletop_perception
