#pragma once

#include <cstddef>
#include <vector>

#include "voxel_key.h"

namespace tabletop_perception {

/// Numbers keys from 0 up, in the order in which they are first asked for: a hash table with open
/// addressing, which a key that comes several times in a row enters once.
template <typename Key, typename Hash>
class Numbering {
 public:
  int size() const { return static_cast<int>(keys_.size()); }
  const Key& key(int number) const { return keys_[number]; }

  /// The number of a key; a new one gets size().
  int numberOf(const Key& key) {
    if (last_ >= 0 && keys_[last_] == key) return last_;
    std::size_t slot = slotOf(key);
    if (slots_[slot] < 0) {
      if (2 * (keys_.size() + 1) > slots_.size()) {
        grow();
        slot = slotOf(key);
      }
      slots_[slot] = size();
      keys_.push_back(key);
    }
    return last_ = slots_[slot];
  }

  /// The number of a key; -1 if it has none.
  int find(const Key& key) const { return slots_[slotOf(key)]; }

 private:
  /// Where the key is, or belongs.
  std::size_t slotOf(const Key& key) const {
    const std::size_t mask = slots_.size() - 1;
    std::size_t slot = Hash()(key) & mask;
    while (slots_[slot] >= 0 && !(keys_[slots_[slot]] == key)) slot = (slot + 1) & mask;
    return slot;
  }

  void grow() {
    slots_.assign(2 * slots_.size(), -1);
    for (int number = 0; number < size(); ++number) slots_[slotOf(keys_[number])] = number;
  }

  std::vector<Key> keys_;
  std::vector<int> slots_ = std::vector<int>(1 << 12, -1);  ///< as many as a power of two
  int last_ = -1;
};

/// The cubes of a grid, numbered as their points come.
using VoxelNumbers = Numbering<VoxelKey, VoxelKeyHash>;

}  // namespace tabletop_perception
