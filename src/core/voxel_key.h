#pragma once

#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace tabletop_perception {

/// The cube of a regular grid that holds a point. 64 bits an axis: no extent overflows.
struct VoxelKey {
  std::int64_t x, y, z;

  static VoxelKey of(const Eigen::Vector3f& p, double inverse_leaf) {
    return {floorOf(p.x() * inverse_leaf), floorOf(p.y() * inverse_leaf),
            floorOf(p.z() * inverse_leaf)};
  }
  bool operator==(const VoxelKey& other) const {
    return x == other.x && y == other.y && z == other.z;
  }

 private:
  /// std::floor is a call on processors without SSE4.
  static std::int64_t floorOf(double value) {
    const auto towards_zero = static_cast<std::int64_t>(value);
    return towards_zero - (value < static_cast<double>(towards_zero));
  }
};

struct VoxelKeyHash {
  std::size_t operator()(const VoxelKey& key) const {
    auto h = static_cast<std::uint64_t>(key.x) * 0x9E3779B97F4A7C15ull;
    h = (h ^ (h >> 32)) + static_cast<std::uint64_t>(key.y) * 0xC2B2AE3D27D4EB4Full;
    h = (h ^ (h >> 29)) + static_cast<std::uint64_t>(key.z) * 0x165667B19E3779F9ull;
    return static_cast<std::size_t>(h ^ (h >> 31));
  }
};

}  // namespace tabletop_perception
