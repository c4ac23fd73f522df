#include "tabletop_perception/random.h"

#include <algorithm>
#include <cmath>

namespace tabletop_perception {
namespace {

std::mt19937_64 seeded(std::uint64_t seed, std::uint64_t stream) {
  std::seed_seq words{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                      static_cast<std::uint32_t>(stream), static_cast<std::uint32_t>(stream >> 32)};
  return std::mt19937_64(words);
}

}  // namespace

Random::Random(std::uint64_t seed, std::uint64_t stream) : engine_(seeded(seed, stream)) {}

double Random::uniform(double from, double to) {
  constexpr double STEP = 0x1p-53;  // of the numbers in [0, 1)
  return from + (to - from) * (static_cast<double>(engine_() >> 11) * STEP);
}

double Random::normal() {
  // Box and Muller 1958; the second of the two numbers is not kept.
  const double radius = std::sqrt(-2 * std::log(1 - uniform(0, 1)));
  return radius * std::cos(2 * M_PI * uniform(0, 1));
}

std::size_t Random::index(std::size_t count) {
  return std::min(static_cast<std::size_t>(uniform(0, static_cast<double>(count))), count - 1);
}

}  // namespace tabletop_perception
