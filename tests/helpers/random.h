/// \file random.h
/// Reproducible chance for tests: one generator, the same numbers on every machine, no library distributions.
#pragma once
#include <cstdint>

namespace tessera::test {

class Random {
 public:
  explicit Random(std::uint64_t seed = 1) : state_(seed * 2 + 1) {}
  /// 53 bits: a linear congruential generator's high ones.
  std::uint64_t bits() {
    state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
    return state_ >> 11;
  }
  std::uint64_t below(std::uint64_t limit) { return bits() % limit; }
  double unit() { return static_cast<double>(bits()) * 0x1p-53; }  ///< [0, 1)
  double in(double low, double high) { return low + (high - low) * unit(); }
  /// Mean 0, deviation 1: the sum of twelve uniform numbers.
  double gaussian() {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += unit();
    return sum;
  }

 private:
  std::uint64_t state_;
};

}  // namespace tessera::test
