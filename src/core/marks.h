#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tabletop_perception/geometry.h"

namespace tabletop_perception {

/// Which points of the parts of a scene are marked. In words of bits: decisions count what two
/// marks have in common for every pair of hypotheses.
class Marks {
 public:
  Marks() = default;
  explicit Marks(const std::vector<Surface>& parts);

  bool at(std::size_t part, std::size_t point) const {
    return bits_[first_word_[part] + point / BITS] >> point % BITS & 1;
  }
  /// Marks points of a part. `marked`: a bit for each of them, 32 in a word, the lowest first.
  void mark(std::size_t part, const std::vector<std::uint32_t>& marked);
  /// Marks what `other` marks, too.
  void mark(const Marks& other);

  int count() const;
  int count(std::size_t part) const;

 private:
  friend int commonOf(const Marks& a, const Marks& b);
  static constexpr std::size_t BITS = 64;

  std::vector<std::size_t> first_word_;  // of each part, and the end
  std::vector<std::uint64_t> bits_;
};

/// How many points are marked in both. Of the same parts.
int commonOf(const Marks& a, const Marks& b);

}  // namespace tabletop_perception
