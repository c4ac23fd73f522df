#include "marks.h"

#include "simd.h"

namespace tabletop_perception {
namespace {

TABLETOP_SIMD_CLONES int countBits(const std::uint64_t* words, std::size_t count) {
  int sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += __builtin_popcountll(words[i]);
  return sum;
}

TABLETOP_SIMD_CLONES int countCommonBits(const std::uint64_t* a, const std::uint64_t* b,
                                         std::size_t count) {
  int sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += __builtin_popcountll(a[i] & b[i]);
  return sum;
}

}  // namespace

Marks::Marks(const std::vector<Surface>& parts) : first_word_{0} {
  for (const auto& part : parts)
    first_word_.push_back(first_word_.back() + (part.size() + BITS - 1) / BITS);
  bits_.assign(first_word_.back(), 0);
}

void Marks::mark(std::size_t part, const std::vector<std::uint32_t>& marked) {
  std::uint64_t* const words = bits_.data() + first_word_[part];
  for (std::size_t i = 0; i < marked.size(); ++i)
    words[i / 2] |= static_cast<std::uint64_t>(marked[i]) << BITS / 2 * (i % 2);
}

void Marks::mark(const Marks& other) {
  for (std::size_t i = 0; i < bits_.size(); ++i) bits_[i] |= other.bits_[i];
}

int Marks::count() const { return countBits(bits_.data(), bits_.size()); }

int Marks::count(std::size_t part) const {
  return countBits(bits_.data() + first_word_[part], first_word_[part + 1] - first_word_[part]);
}

int commonOf(const Marks& a, const Marks& b) {
  return countCommonBits(a.bits_.data(), b.bits_.data(), a.bits_.size());
}

}  // namespace tabletop_perception
