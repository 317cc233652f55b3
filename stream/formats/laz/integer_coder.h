/// \file integer_coder.h
/// Whole numbers as their difference from a prediction: first how many bits the difference has, then which of those it
/// is, the lowest bits of long ones raw. Source: Isenburg, LASzip: lossless compression of LiDAR data (2013).
#pragma once
#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "stream/formats/laz/symbol_model.h"

namespace tessera::laz {

class IntegerCoder {
 public:
  /// \param bits  of the numbers: 8, 16 or 32
  explicit IntegerCoder(unsigned bits, unsigned contexts = 1) : bits_(bits), lengths_(contexts) {
    for (SymbolModel& m : lengths_) m = SymbolModel(bits + 1);
    for (unsigned k = 1; k <= bits; ++k) values_[k] = SymbolModel(1u << (k < kModelled ? k : kModelled));
  }

  /// Bits of the last difference: a context for what follows.
  unsigned length() const { return length_; }

  /// Codes `actual`, or decodes and returns it. Numbers of 8 and 16 bits are whole numbers from 0; predictions beyond
  /// their range wrap.
  template <class Coder>
  std::int32_t code(Coder& coder, std::int32_t predicted, std::int32_t actual, unsigned context = 0) {
    const auto range = bits_ < 32 ? 1u << bits_ : 0u;
    const auto minimum = static_cast<std::int32_t>(0u - (bits_ < 32 ? range / 2 : 0x80000000u));
    std::uint32_t difference = static_cast<std::uint32_t>(actual) - static_cast<std::uint32_t>(predicted);
    if constexpr (Coder::kEncodes) {
      if (static_cast<std::int32_t>(difference) < minimum)
        difference += range;
      else if (static_cast<std::int32_t>(difference) > -(minimum + 1))
        difference -= range;
    }
    difference = code_difference(coder, difference, static_cast<std::uint32_t>(minimum), context);
    auto real = static_cast<std::int32_t>(static_cast<std::uint32_t>(predicted) + difference);
    if (real < 0)
      real = static_cast<std::int32_t>(static_cast<std::uint32_t>(real) + range);
    else if (static_cast<std::uint32_t>(real) >= range)
      real = static_cast<std::int32_t>(static_cast<std::uint32_t>(real) - range);
    return real;
  }

 private:
  static constexpr unsigned kModelled = 8;  ///< highest bits of a difference that have a model

  /// A difference of k bits lies in [-(2^k - 1), -2^(k-1)] or [2^(k-1) + 1, 2^k]: k bits tell where. k = 0: 0 or 1.
  template <class Coder>
  std::uint32_t code_difference(Coder& coder, std::uint32_t difference, std::uint32_t minimum,
                                unsigned context) {
    const auto sign = static_cast<std::int32_t>(difference);
    length_ =
        coder.symbol(lengths_[context],
                     static_cast<unsigned>(std::bit_width(sign <= 0 ? 0u - difference : difference - 1)));
    const unsigned k = length_;
    if (k == 0) return coder.bit(zero_or_one_, difference & 1u);
    if (k == 32) return minimum;
    const std::uint32_t offset = sign < 0 ? difference + ((1u << k) - 1) : difference - 1;
    std::uint32_t found;
    if (k <= kModelled) {
      found = coder.symbol(values_[k], offset);
    } else {
      const unsigned low = k - kModelled;
      found = coder.symbol(values_[k], offset >> low) << low;
      found |= coder.raw(low, offset & ((1u << low) - 1));
    }
    return found >> (k - 1) != 0 ? found + 1 : found - ((1u << k) - 1);
  }

  unsigned bits_;
  unsigned length_ = 0;
  std::vector<SymbolModel> lengths_;  ///< by context
  std::array<SymbolModel, 33> values_;
  BitModel zero_or_one_;
};

}  // namespace tessera::laz
