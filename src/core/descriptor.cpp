#include "tabletop_perception/descriptor.h"

#include <algorithm>
#include <limits>

#include "tabletop_perception/region_growing.h"

namespace tabletop_perception {

std::vector<std::vector<int>> smoothRegions(const Surface& surface,
                                            const DescriptorOptions& options) {
  RegionGrowingOptions growing;
  growing.smooth_angle_deg = options.region_angle_deg;
  growing.max_curvature = options.region_curvature;
  growing.gap = options.region_radius;
  growing.min_points = options.region_min_points;
  return growRegions(surface, growing);
}

std::vector<Surface> smoothParts(const Surface& surface, const DescriptorOptions& options) {
  std::vector<bool> in_part(surface.size(), false);
  std::vector<Surface> parts;
  for (const auto& region : smoothRegions(surface, options)) {
    for (const int i : region) in_part[i] = true;
    parts.push_back(selected(surface, region));
  }
  std::vector<int> rest;
  for (std::size_t i = 0; i < surface.size(); ++i)
    if (!in_part[i]) rest.push_back(static_cast<int>(i));
  parts.push_back(selected(surface, rest));
  return parts;
}

std::vector<Descriptor> describeSurface(const Surface& surface, const Eigen::Vector3f& viewpoint,
                                        const DescriptorOptions& options,
                                        const std::vector<std::string>& kinds) {
  if (static_cast<int>(surface.size()) < options.min_points) return {};
  const auto wanted = [&](const char* kind) {
    return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
  };
  std::vector<Descriptor> all;
  const auto add = [&](std::vector<Descriptor> descriptors) {
    std::move(descriptors.begin(), descriptors.end(), std::back_inserter(all));
  };
  if (wanted("vfh")) all.push_back(computeVfh(surface, viewpoint));
  if (wanted("cvfh") || wanted("our_cvfh")) {
    const auto regions = smoothRegions(surface, options);
    if (wanted("cvfh")) add(computeCvfh(surface, regions, viewpoint));
    if (wanted("our_cvfh")) add(computeOurCvfh(surface, regions, viewpoint));
  }
  if (wanted("esf")) all.push_back(computeEsf(surface, options.leaf));
  all.push_back(computeCameraRoll(surface, viewpoint));
  return all;
}

}  // namespace tabletop_perception
