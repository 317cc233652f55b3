/// \file colour_coder.h
/// Colours of 16 bits a channel, byte by byte, green and blue predicted by what red did: RGB12 version 2 and RGB14, and
/// the near infrared beside it. Source: ASPRS LAZ specification 1.4.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>

#include "stream/formats/laz/symbol_model.h"

namespace tessera::laz {

using Rgb = std::array<std::uint16_t, 3>;

inline unsigned low_byte(std::uint16_t v) {
  return v & 0xffu;
}
inline unsigned high_byte(std::uint16_t v) {
  return v >> 8;
}
inline std::uint16_t from_bytes(unsigned low, unsigned high) {
  return static_cast<std::uint16_t>(low | high << 8);
}

/// A byte as its difference from a prediction.
template <class Coder>
unsigned code_byte(Coder& coder, SymbolModel& model, unsigned predicted, unsigned actual) {
  return (predicted + coder.symbol(model, (actual - predicted) & 0xffu)) & 0xffu;
}

class RgbCoder {
 public:
  /// The colour after `last`: `actual` coded, or decoded and returned.
  template <class Coder>
  Rgb code(Coder& coder, const Rgb& last, const Rgb& actual) {
    unsigned mask = 0;
    if constexpr (Coder::kEncodes) {
      for (unsigned c = 0; c < 3; ++c) {
        mask |= (low_byte(last[c]) != low_byte(actual[c]) ? 1u : 0u) << (2 * c);
        mask |= (high_byte(last[c]) != high_byte(actual[c]) ? 2u : 0u) << (2 * c);
      }
      mask |= actual[0] != actual[1] || actual[0] != actual[2] ? kNotGrey : 0;
    }
    mask = coder.symbol(changed_, mask);
    unsigned low[3], high[3];
    low[0] = mask & 1 ? code_byte(coder, differences_[0], low_byte(last[0]), low_byte(actual[0]))
                      : low_byte(last[0]);
    high[0] = mask & 2 ? code_byte(coder, differences_[1], high_byte(last[0]), high_byte(actual[0]))
                       : high_byte(last[0]);
    if ((mask & kNotGrey) == 0) {
      const std::uint16_t grey = from_bytes(low[0], high[0]);
      return {grey, grey, grey};
    }
    code_rest(coder, mask, 0, low_byte, last, actual, low);
    code_rest(coder, mask >> 1, 1, high_byte, last, actual, high);
    return {from_bytes(low[0], high[0]), from_bytes(low[1], high[1]), from_bytes(low[2], high[2])};
  }

 private:
  static constexpr unsigned kNotGrey = 64;

  /// Green and blue, low or high bytes. \param mask  bits 2 and 4: whether they changed
  template <class Coder, class Byte>
  void code_rest(Coder& coder, unsigned mask, std::size_t half, Byte byte, const Rgb& last, const Rgb& actual,
                 unsigned (&now)[3]) {
    const auto change = [&](unsigned c) {
      return static_cast<int>(now[c]) - static_cast<int>(byte(last[c]));
    };
    const auto predicted = [&](unsigned c, int by) {
      return static_cast<unsigned>(std::clamp(static_cast<int>(byte(last[c])) + by, 0, 255));
    };
    const int red = change(0);
    now[1] = mask & 4 ? code_byte(coder, differences_[2 + half], predicted(1, red), byte(actual[1]))
                      : byte(last[1]);
    now[2] = mask & 16 ? code_byte(coder, differences_[4 + half], predicted(2, (red + change(1)) / 2),
                                   byte(actual[2]))
                       : byte(last[2]);
  }

  SymbolModel changed_{128};
  ModelSet<6, 256> differences_;  ///< red low, red high, green low, ...
};

class NirCoder {
 public:
  template <class Coder>
  std::uint16_t code(Coder& coder, std::uint16_t last, std::uint16_t actual) {
    unsigned mask =
        (low_byte(last) != low_byte(actual) ? 1u : 0u) | (high_byte(last) != high_byte(actual) ? 2u : 0u);
    mask = coder.symbol(changed_, mask);
    const unsigned low =
        mask & 1 ? code_byte(coder, differences_[0], low_byte(last), low_byte(actual)) : low_byte(last);
    const unsigned high =
        mask & 2 ? code_byte(coder, differences_[1], high_byte(last), high_byte(actual)) : high_byte(last);
    return from_bytes(low, high);
  }

 private:
  SymbolModel changed_{4};
  ModelSet<2, 256> differences_;
};

}  // namespace tessera::laz
