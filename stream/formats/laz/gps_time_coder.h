/// \file gps_time_coder.h
/// GPS times as multiples of the step before, in up to four interleaved sequences: GPSTIME11 version 2, and the layer of
/// POINT14, which has no symbol for "unchanged". Source: ASPRS LAZ specification 1.4.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "stream/formats/laz/integer_coder.h"
#include "stream/formats/laz/symbol_model.h"

namespace tessera::laz {

/// Nearest multiple of `step` to `difference`, within [least, most]. \pre  step != 0
inline int nearest_multiple(std::int32_t difference, std::int32_t step, int minimum, int maximum) {
  const double ratio = static_cast<double>(difference) / static_cast<double>(step);
  return static_cast<int>(
      std::clamp(std::floor(ratio + 0.5), static_cast<double>(minimum), static_cast<double>(maximum)));
}

inline std::int32_t times(int multiple, std::int32_t step) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(multiple) * static_cast<std::uint32_t>(step));
}

inline bool fits_32_bits(std::uint64_t difference) {
  return static_cast<std::int64_t>(difference) == static_cast<std::int32_t>(difference);
}

template <bool kSaysUnchanged>
class GpsTimeCoder {
 public:
  void start(std::uint64_t time) { times_[0] = time; }

  template <class Coder>
  std::uint64_t code(Coder& coder, std::uint64_t actual) {
    while (!code_in_sequence(coder, actual)) {
    }
    return times_[at_];
  }

 private:
  static constexpr unsigned kFirst = kSaysUnchanged ? 1 : 0;
  static constexpr int kMax = 500;
  static constexpr int kMin = -10;
  static constexpr unsigned kSame = kMax - kMin + 1;  ///< first symbol after the multiples
  static constexpr unsigned kNew = kSame + kFirst;
  static constexpr int kPatience = 3;  ///< odd steps in a row before one becomes the step

  /// False where another sequence was chosen, in which the time is then coded.
  template <class Coder>
  bool code_in_sequence(Coder& coder, std::uint64_t actual) {
    std::int32_t& step = steps_[at_];
    const std::uint64_t difference = actual - times_[at_];
    const bool far = Coder::kEncodes && !fits_32_bits(difference);
    const unsigned new_symbol = step == 0 ? kFirst + 1 : kNew;
    unsigned symbol = far ? new_symbol + other_sequence(actual) : 0;
    if (step == 0) {
      if (!far) symbol = kSaysUnchanged && difference == 0 ? 0 : kFirst;
      symbol = coder.symbol(without_step_, symbol);
      if (symbol < kFirst) return true;
      if (symbol == kFirst) {
        step = integers_.code(coder, 0, static_cast<std::int32_t>(difference), 0);
        advance(step);
        odd_[at_] = 0;
        return true;
      }
    } else {
      if (Coder::kEncodes && !far) symbol = symbol_of(difference, step);
      symbol = coder.symbol(with_step_, symbol);
      if (symbol < kSame) {
        code_multiple(coder, symbol, static_cast<std::int32_t>(difference));
        return true;
      }
      if (symbol < kNew) return true;
    }
    if (symbol > new_symbol) {
      at_ = (at_ + symbol - new_symbol) & 3u;
      return false;
    }
    const auto high = integers_.code(coder, static_cast<std::int32_t>(times_[at_] >> 32),
                                     static_cast<std::int32_t>(actual >> 32), 8);
    next_ = (next_ + 1) & 3u;
    at_ = next_;
    times_[at_] = std::uint64_t{static_cast<std::uint32_t>(high)} << 32 |
                  coder.raw(32, static_cast<std::uint32_t>(actual));
    steps_[at_] = 0;
    odd_[at_] = 0;
    return true;
  }

  /// How many sequences on the time lies near, 0 if near none.
  unsigned other_sequence(std::uint64_t actual) const {
    for (unsigned i = 1; i < 4; ++i)
      if (fits_32_bits(actual - times_[(at_ + i) & 3u])) return i;
    return 0;
  }

  static unsigned symbol_of(std::uint64_t difference, std::int32_t step) {
    if (kSaysUnchanged && difference == 0) return kSame;
    const int multiple = nearest_multiple(static_cast<std::int32_t>(difference), step, kMin, kMax);
    return static_cast<unsigned>(multiple < 0 ? kMax - multiple : multiple);
  }

  template <class Coder>
  void code_multiple(Coder& coder, unsigned symbol, std::int32_t difference) {
    const int s = static_cast<int>(symbol);
    const int multiple = s <= kMax ? s : kMax - s;
    const unsigned context = s == 1            ? 1
                             : s == 0          ? 7
                             : s < 10          ? 2
                             : s < kMax        ? 3
                             : s == kMax       ? 4
                             : multiple > kMin ? 5
                                               : 6;
    const std::int32_t found = integers_.code(coder, times(multiple, steps_[at_]), difference, context);
    advance(found);
    const bool odd = s == 0 || multiple == kMax || multiple == kMin;
    if (s == 1) odd_[at_] = 0;
    if (odd && ++odd_[at_] > kPatience) {
      steps_[at_] = found;
      odd_[at_] = 0;
    }
  }

  void advance(std::int32_t step) { times_[at_] += static_cast<std::uint64_t>(std::int64_t{step}); }

  std::array<std::uint64_t, 4> times_{};  ///< bits of doubles
  std::array<std::int32_t, 4> steps_{};
  std::array<int, 4> odd_{};
  unsigned at_ = 0;
  unsigned next_ = 0;
  SymbolModel without_step_{kFirst + 5};
  SymbolModel with_step_{kNew + 4};
  IntegerCoder integers_{32, 9};
};

}  // namespace tessera::laz
