#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

namespace tabletop_perception {

/// Random numbers that are the same with every standard library: of <random>, only the engine and
/// std::seed_seq are fixed by the standard, its distributions are not.
class Random {
 public:
  /// Streams of one seed are independent of each other: one for each of a series of things.
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0);

  /// Evenly spread over [from, to).
  double uniform(double from, double to);

  /// Normally distributed, mean 0, standard deviation 1.
  double normal();

  /// One of 0 ... count - 1; `count` must be positive.
  std::size_t index(std::size_t count);

 private:
  std::mt19937_64 engine_;
};

}  // namespace tabletop_perception
