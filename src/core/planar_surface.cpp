#include "tabletop_perception/planar_surface.h"

#include <limits>

namespace tabletop_perception {

PlanarSurface::PlanarSurface(const Surface& surface)
    : blocks((surface.size() + PlanarBlock::SIZE - 1) / PlanarBlock::SIZE), size(surface.size()) {
  const Eigen::Vector3f none = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < blocks.size() * PlanarBlock::SIZE; ++i) {
    PlanarBlock& block = blocks[i / PlanarBlock::SIZE];
    const std::size_t lane = i % PlanarBlock::SIZE;
    const bool there = i < size && surface.points[i].allFinite() && surface.normals[i].allFinite();
    const Eigen::Vector3f& p = there ? surface.points[i] : none;
    const Eigen::Vector3f& n = there ? surface.normals[i] : none;
    block.x[lane] = p.x(), block.y[lane] = p.y(), block.z[lane] = p.z();
    block.nx[lane] = n.x(), block.ny[lane] = n.y(), block.nz[lane] = n.z();
  }
}

void PlanarSurface::append(const PlanarSurface& other) {
  blocks.insert(blocks.end(), other.blocks.begin(), other.blocks.end());
  size += other.size;
}

}  // namespace tabletop_perception
