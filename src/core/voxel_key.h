#pragma once

#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace tabletop_perception {

/// The cube of a regular grid that holds a point. Beyond 2^30 cubes from the origin, on any axis,
/// the last one holds all: no extent overflows.
struct VoxelKey {
  std::int32_t x, y, z;

  static VoxelKey of(const Eigen::Vector3f& p, double inverse_leaf) {
    return {floorOf(p.x() * inverse_leaf), floorOf(p.y() * inverse_leaf),
            floorOf(p.z() * inverse_leaf)};
  }
  bool operator==(const VoxelKey& other) const {
    return x == other.x && y == other.y && z == other.z;
  }

  /// The cube's number along an axis. Shifted above zero, where truncation is floor: std::floor is
  /// a call on processors without SSE4.
  static std::int32_t floorOf(double value) {
    constexpr std::int32_t LAST = 1 << 30;
    const double within = value < -LAST ? -LAST : value > LAST - 1 ? LAST - 1 : value;
    return static_cast<std::int32_t>(within + LAST) - LAST;
  }
};

struct VoxelKeyHash {
  std::size_t operator()(const VoxelKey& key) const {
    auto h = static_cast<std::uint32_t>(key.x) * 0x9E3779B97F4A7C15ull;
    h = (h ^ (h >> 32)) + static_cast<std::uint32_t>(key.y) * 0xC2B2AE3D27D4EB4Full;
    h = (h ^ (h >> 29)) + static_cast<std::uint32_t>(key.z) * 0x165667B19E3779F9ull;
    return static_cast<std::size_t>(h ^ (h >> 31));
  }
};

}  // namespace tabletop_perception
