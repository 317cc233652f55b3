/// \file cost_queue.h
/// A queue of items by integer cost class: first in, first out inside a class, so the order is a pure
/// function of the pushes. Constant time, no allocation after construction.
#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

/// Eight classes to a factor of two, from 2^-200 on (everything below, and 0, is class 0).
/// \pre cost is not a NaN
[[nodiscard]] inline std::uint32_t cost_class(double cost, std::size_t classes) {
  if (!(cost > 0x1p-200)) return 0;
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(cost) >> 49;  // 11 bits of exponent, 3 of mantissa
  const std::uint64_t lowest = std::bit_cast<std::uint64_t>(0x1p-200) >> 49;
  const std::uint64_t c = bits - lowest + 1;
  return c < classes ? static_cast<std::uint32_t>(c) : static_cast<std::uint32_t>(classes - 1);
}

template <std::size_t kClasses>
class CostQueue {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  explicit CostQueue(std::size_t items = 0) : next_(items, kNone), queued_(items, 0) {
    head_.fill(kNone);
    tail_.fill(kNone);
  }
  [[nodiscard]] bool contains(std::uint32_t item) const { return queued_[item] != 0; }
  /// \pre !contains(item)
  void push(std::uint32_t item, std::uint32_t cost) {
    next_[item] = kNone;
    queued_[item] = 1;
    if (head_[cost] == kNone)
      head_[cost] = item;
    else
      next_[tail_[cost]] = item;
    tail_[cost] = item;
    if (cost < lowest_) lowest_ = cost;
  }
  /// The first item of the lowest class. \return false when empty
  bool pop(std::uint32_t& item, std::uint32_t& cost) {
    while (lowest_ < kClasses && head_[lowest_] == kNone) ++lowest_;
    if (lowest_ == kClasses) return false;
    cost = static_cast<std::uint32_t>(lowest_);
    item = head_[lowest_];
    head_[lowest_] = next_[item];
    queued_[item] = 0;
    return true;
  }

 private:
  std::array<std::uint32_t, kClasses> head_{}, tail_{};
  std::vector<std::uint32_t> next_;
  std::vector<std::uint8_t> queued_;
  std::size_t lowest_ = kClasses;
};

}  // namespace tessera
