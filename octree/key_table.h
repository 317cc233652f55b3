/// \file key_table.h
/// Numbers 64-bit keys in the order in which they come.
#pragma once
#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace tessera {

/// Open addressing, linear probing; at most half full.
class KeyTable {
 public:
  /// The key's number, and whether it came for the first time. \pre fewer than 2^31 keys
  std::pair<std::uint32_t, bool> add(std::uint64_t key) {
    if (2 * (keys_.size() + 1) > slots_.size()) grow(std::max(kFirstSlots, 2 * slots_.size()));
    std::size_t at = slot_of(key);
    for (; slots_[at] != 0; at = (at + 1) & (slots_.size() - 1))
      if (keys_[slots_[at] - 1] == key) return {slots_[at] - 1, false};
    keys_.push_back(key);
    slots_[at] = static_cast<std::uint32_t>(keys_.size());
    return {slots_[at] - 1, true};
  }
  /// Its number, or size() where it never came.
  [[nodiscard]] std::size_t find(std::uint64_t key) const {
    if (slots_.empty()) return 0;
    for (std::size_t at = slot_of(key); slots_[at] != 0; at = (at + 1) & (slots_.size() - 1))
      if (keys_[slots_[at] - 1] == key) return slots_[at] - 1;
    return size();
  }
  [[nodiscard]] std::size_t size() const { return keys_.size(); }
  /// Makes room for so many keys at once: growing takes twice that, and copies.
  void reserve(std::size_t keys) {
    keys_.reserve(keys);
    if (2 * keys > slots_.size()) grow(std::bit_ceil(2 * keys));
  }
  void clear() {
    keys_.clear();
    std::fill(slots_.begin(), slots_.end(), 0);
  }
  [[nodiscard]] std::span<const std::uint64_t> keys() const { return keys_; }  ///< by number
  /// Upper bound of what a table of so many keys holds while it grows.
  [[nodiscard]] static constexpr std::size_t bytes(std::size_t keys) { return 40 * keys + 4096; }

 private:
  std::size_t slot_of(std::uint64_t key) const {
    // Fibonacci hashing: neighbours in a grid differ in their low bits.
    return static_cast<std::size_t>((key * 0x9e3779b97f4a7c15u) >> shift_);
  }
  static constexpr std::size_t kFirstSlots = 256;
  /// \param slots  a power of two
  void grow(std::size_t slots) {
    shift_ = 64 - std::countr_zero(slots);
    slots_.assign(slots, 0);
    for (std::size_t k = 0; k < keys_.size(); ++k) {
      std::size_t at = slot_of(keys_[k]);
      while (slots_[at] != 0) at = (at + 1) & (slots - 1);
      slots_[at] = static_cast<std::uint32_t>(k + 1);
    }
  }

  std::vector<std::uint64_t> keys_;
  std::vector<std::uint32_t> slots_;  ///< number + 1, 0 = free; a power of two
  int shift_ = 64;
};

}  // namespace tessera
