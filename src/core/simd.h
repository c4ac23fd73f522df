#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace tabletop_perception {

/// `value`, or 0 where the condition does not hold, NaN or not. By bits: a choice between two
/// values is turned into a jump before loops are vectorised.
inline float zeroUnless(bool condition, float value) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  bits &= -static_cast<std::uint32_t>(condition);
  std::memcpy(&value, &bits, sizeof bits);
  return value;
}

/// `value`, or NaN where the condition does not hold. By bits, as above.
inline float nanUnless(bool condition, float value) {
  constexpr std::uint32_t QUIET_NAN = 0x7FC00000;
  const std::uint32_t mask = -static_cast<std::uint32_t>(condition);
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  bits = (bits & mask) | (QUIET_NAN & ~mask);
  std::memcpy(&value, &bits, sizeof bits);
  return value;
}

/// So many floats side by side, which a kernel can keep in one wide register: where loops over
/// arrays would go through memory. No function may take or return them by value.
constexpr int FLOATS = 8;
typedef float Floats __attribute__((vector_size(FLOATS * sizeof(float))));
typedef std::int32_t FloatMasks __attribute__((vector_size(FLOATS * sizeof(float))));

inline void load(const float* from, Floats& to) { std::memcpy(&to, from, sizeof to); }
inline void store(const Floats& from, float* to) { std::memcpy(to, &from, sizeof from); }

/// Sets to 0 the values where the mask, as comparisons give it, is false, NaN or not.
inline void keepWhere(const FloatMasks& mask, Floats& values) {
  FloatMasks bits;
  std::memcpy(&bits, &values, sizeof bits);
  bits &= mask;
  std::memcpy(&values, &bits, sizeof bits);
}

/// Has memory fetched that a pass comes to soon, which processors do by themselves only up to the
/// next page. Any address will do. `for_writing`: what is there will be changed.
template <bool for_writing = false>
inline void prefetch(const void* begin, std::size_t bytes) {
  constexpr std::size_t CACHE_LINE = 64;
  const auto* at = static_cast<const char*>(begin);
  for (std::size_t i = 0; i < bytes; i += CACHE_LINE) __builtin_prefetch(at + i, for_writing, 2);
}

}  // namespace tabletop_perception

/// Marks a kernel over planar float arrays that is worth a copy for wide registers: the loader
/// takes the copy that the machine can run, so what ships needs no -march. Sanitizers cannot follow
/// the choice, other processors have no such copies; both run the plain code.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TABLETOP_SIMD_CLONES __attribute__((target_clones("default", "avx2")))
#else
#define TABLETOP_SIMD_CLONES
#endif
