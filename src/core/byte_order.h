#pragma once

#include <cstdint>
#include <cstring>

namespace tabletop_perception {

/// Whether this machine stores numbers with the most significant byte first.
inline bool hostIsBigEndian() {
  const std::uint16_t one = 1;
  std::uint8_t first;
  std::memcpy(&first, &one, 1);
  return first == 0;
}

}  // namespace tabletop_perception
