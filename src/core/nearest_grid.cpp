#include "tabletop_perception/nearest_grid.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "simd.h"
#include "tabletop_perception/kd_tree.h"

namespace tabletop_perception {
namespace {

constexpr int SIZE = PlanarBlock::SIZE;
constexpr double MAX_CELLS = 4 << 20;  // as a cube of 0.6 m in cells of 4 mm; larger things get
constexpr double COARSER = 1.1;        // larger cells, step by step
constexpr float NONE = std::numeric_limits<float>::infinity();

/// Where the grid lies and how points come into its frame, for the kernel.
struct Lattice {
  float T[12];  // rows of rotation and translation
  float origin[3], inverse_cell;
  std::int32_t size[3];
};

/// The points at the pose, and the cell of each; -1 outside of the grid.
TABLETOP_SIMD_CLONES void locate(const PlanarBlock& __restrict points,
                                 const Lattice& __restrict lattice, Correspondences& __restrict out,
                                 std::int32_t* __restrict cells) {
  const float* T = lattice.T;
  const std::int32_t width = lattice.size[0], height = lattice.size[1], depth = lattice.size[2];
  // One more than the cell along an axis, from 0 to that beyond the end: there truncation is floor.
  // The order of arguments turns NaN into 0.
  const auto along = [&](float offset, float last) {
    return static_cast<std::int32_t>(
        std::min(last, std::max(0.0f, offset * lattice.inverse_cell + 1)));
  };
  const float ends[3] = {width + 1.0f, height + 1.0f, depth + 1.0f};
  for (int i = 0; i < SIZE; ++i) {
    const float x = T[0] * points.x[i] + T[1] * points.y[i] + T[2] * points.z[i] + T[3];
    const float y = T[4] * points.x[i] + T[5] * points.y[i] + T[6] * points.z[i] + T[7];
    const float z = T[8] * points.x[i] + T[9] * points.y[i] + T[10] * points.z[i] + T[11];
    out.x[i] = x;
    out.y[i] = y;
    out.z[i] = z;
    const std::int32_t u = along(x - lattice.origin[0], ends[0]) - 1;
    const std::int32_t v = along(y - lattice.origin[1], ends[1]) - 1;
    const std::int32_t w = along(z - lattice.origin[2], ends[2]) - 1;
    // All bits set where one of them is negative. By bits: a choice would become a jump.
    const std::int32_t outside =
        (u | v | w | (width - 1 - u) | (height - 1 - v) | (depth - 1 - w)) >> 31;
    cells[i] = ((w * height + v) * width + u) | outside;
  }
}

/// Lays four facets side by side, from the point `at` on.
template <typename Facet>
inline void unpack(const Facet& a, const Facet& b, const Facet& c, const Facet& d, int at,
                   Correspondences& out) {
  using Four = float __attribute__((vector_size(16)));
  const auto four = [](const float* from) {
    Four values;
    std::memcpy(&values, from, sizeof values);
    return values;
  };
  const auto store = [&](Four values, float* to) { std::memcpy(to + at, &values, sizeof values); };
  const Four xyz_a = four(&a.x), xyz_b = four(&b.x), xyz_c = four(&c.x), xyz_d = four(&d.x);
  const Four xy_ab = __builtin_shufflevector(xyz_a, xyz_b, 0, 4, 1, 5);
  const Four xy_cd = __builtin_shufflevector(xyz_c, xyz_d, 0, 4, 1, 5);
  const Four z_ab = __builtin_shufflevector(xyz_a, xyz_b, 2, 6, 3, 7);  // and the normals' x
  const Four z_cd = __builtin_shufflevector(xyz_c, xyz_d, 2, 6, 3, 7);
  store(__builtin_shufflevector(xy_ab, xy_cd, 0, 1, 4, 5), out.dx);
  store(__builtin_shufflevector(xy_ab, xy_cd, 2, 3, 6, 7), out.dy);
  store(__builtin_shufflevector(z_ab, z_cd, 0, 1, 4, 5), out.dz);
  store(__builtin_shufflevector(z_ab, z_cd, 2, 3, 6, 7), out.nx);
  const Four yz_ab = __builtin_shufflevector(four(&a.ny), four(&b.ny), 0, 4, 1, 5);
  const Four yz_cd = __builtin_shufflevector(four(&c.ny), four(&d.ny), 0, 4, 1, 5);
  store(__builtin_shufflevector(yz_ab, yz_cd, 0, 1, 4, 5), out.ny);
  store(__builtin_shufflevector(yz_ab, yz_cd, 2, 3, 6, 7), out.nz);
}

/// Turns nearest points into correspondences. `out`: with the nearest points in dx, dy, dz.
TABLETOP_SIMD_CLONES void judge(const PlanarBlock& points, const Lattice& lattice,
                                const std::int32_t* cells, float max_squared, float min_squared_dot,
                                Correspondences& out) {
  const float* T = lattice.T;
  for (int i = 0; i < SIZE; ++i) {
    const float dx = out.dx[i] - out.x[i];
    const float dy = out.dy[i] - out.y[i];
    const float dz = out.dz[i] - out.z[i];
    const float squared = dx * dx + dy * dy + dz * dz;
    const float nx = T[0] * points.nx[i] + T[1] * points.ny[i] + T[2] * points.nz[i];
    const float ny = T[4] * points.nx[i] + T[5] * points.ny[i] + T[6] * points.nz[i];
    const float nz = T[8] * points.nx[i] + T[9] * points.ny[i] + T[10] * points.nz[i];
    const float dot = nx * out.nx[i] + ny * out.ny[i] + nz * out.nz[i];
    const bool corresponds =
        (cells[i] >= 0) & (squared <= max_squared) & (dot * dot >= min_squared_dot);
    out.dx[i] = dx;
    out.dy[i] = dy;
    out.dz[i] = dz;
    out.squared[i] = corresponds ? squared : NONE;
  }
}

}  // namespace

NearestGrid::NearestGrid(const Surface& surface, double cell, double margin) {
  if (surface.empty()) throw std::invalid_argument("nearest grid: the surface has no points");
  Eigen::Vector3f low = surface.points.front(), high = low;
  for (const auto& p : surface.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const auto& p = surface.points[i];
    const auto& n = surface.normals[i];
    facets_.push_back({p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), 0, 0});
  }
  const auto wide = static_cast<float>(margin);
  origin_ = low.array() - wide;
  const Eigen::Array3d extent = (high - origin_).cast<double>().array() + margin;
  const auto cellsAt = [&](double side) { return (extent / side).ceil().max(1).eval(); };
  while (cellsAt(cell).prod() > MAX_CELLS) cell *= COARSER;
  inverse_cell_ = static_cast<float>(1.0 / cell);
  size_ = cellsAt(cell).cast<int>();

  const KdTree tree(surface.points);
  const std::size_t count = static_cast<std::size_t>(size_.x()) * size_.y() * size_.z();
  const bool narrow = surface.size() <= std::numeric_limits<std::uint16_t>::max() + 1u;
  narrow ? cells_.resize(count) : wide_cells_.resize(count);
  std::size_t i = 0;
  for (int z = 0; z < size_.z(); ++z)
    for (int y = 0; y < size_.y(); ++y)
      for (int x = 0; x < size_.x(); ++x, ++i) {
        const Eigen::Vector3f offset = Eigen::Vector3f(x, y, z).array() + 0.5f;
        const auto nearest = tree.nearest(origin_ + offset / inverse_cell_).index;
        if (narrow)
          cells_[i] = static_cast<std::uint16_t>(nearest);
        else
          wide_cells_[i] = static_cast<std::uint32_t>(nearest);
      }
}

void NearestGrid::correspond(const PlanarBlock& points, const Eigen::Isometry3f& T_surface_points,
                             float max_squared, Correspondences& out, float min_normal_dot) const {
  Lattice lattice;
  Eigen::Map<Eigen::Matrix<float, 3, 4, Eigen::RowMajor>>(lattice.T) =
      T_surface_points.matrix().topRows<3>();
  Eigen::Map<Eigen::Vector3f>(lattice.origin) = origin_;
  Eigen::Map<Eigen::Array3i>(lattice.size) = size_;
  lattice.inverse_cell = inverse_cell_;

  if (facets_.empty()) {
    std::fill(out.squared, out.squared + SIZE, NONE);
    return;
  }
  alignas(32) std::int32_t cells[SIZE];
  locate(points, lattice, out, cells);
  for (int i = 0; i < SIZE; i += 4) {
    const auto facetOf = [&](std::int32_t cell) -> const Facet& {
      return facets_[cell < 0 ? 0 : indexAt(static_cast<std::size_t>(cell))];
    };
    unpack(facetOf(cells[i]), facetOf(cells[i + 1]), facetOf(cells[i + 2]), facetOf(cells[i + 3]),
           i, out);
  }
  judge(points, lattice, cells, max_squared, min_normal_dot * min_normal_dot, out);
}

std::size_t NearestGrid::memory() const {
  return facets_.size() * sizeof(Facet) + cells_.size() * sizeof(cells_[0]) +
         wide_cells_.size() * sizeof(wide_cells_[0]);
}

}  // namespace tabletop_perception
