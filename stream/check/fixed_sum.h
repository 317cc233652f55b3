/// \file fixed_sum.h
/// A sum of doubles that does not depend on their order: terms are rounded to a fixed unit and added as
/// 128-bit integers.
#pragma once
#include <cassert>
#include <cmath>
#include <cstdint>

namespace tessera {

class FixedSum {
 public:
  FixedSum() = default;
  /// \param largest  no term exceeds it in magnitude; finite, >= 0. The unit is about largest / 2^90, and
  /// 2^35 terms fit.
  explicit FixedSum(double largest) {
    int exponent = 0;
    std::frexp(largest, &exponent);
    unit_ = std::ldexp(1.0, exponent - kBits);
    if (!(unit_ > 0.0)) unit_ = std::ldexp(1.0, -1074);
  }
  void add(double value) { sum_ += static_cast<Int128>(value / unit_); }
  /// \pre of the same largest term
  void add(const FixedSum& other) { sum_ += other.sum_; }
  double value() const { return static_cast<double>(sum_) * unit_; }

 private:
  __extension__ using Int128 = __int128;
  static constexpr int kBits = 90;

  double unit_ = 1.0;
  Int128 sum_ = 0;
};

}  // namespace tessera
