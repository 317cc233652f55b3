/// \file arithmetic_encoder.h
/// Symbols, bits and raw numbers into arithmetically coded bytes: ArithmeticDecoder the other way round. Every call
/// returns what it was given. Source: Said, FastAC; ASPRS LAZ specification.
#pragma once
#include <cstdint>
#include <vector>

#include "stream/formats/laz/symbol_model.h"

namespace tessera::laz {

class ArithmeticEncoder {
 public:
  static constexpr bool kEncodes = true;

  unsigned symbol(SymbolModel& model, unsigned value);
  unsigned bit(BitModel& model, unsigned value);
  /// \pre  1 <= bits <= 32, value < 2^bits
  std::uint32_t raw(unsigned bits, std::uint32_t value);
  /// Writes out what tells the last interval, so that a decoder takes all bytes and not one more. Once, at the end.
  void finish();
  const std::vector<char>& bytes() const { return bytes_; }

 private:
  void raw_few(unsigned bits, std::uint32_t value);
  void advance(std::uint32_t by);
  void renormalise();

  std::vector<char> bytes_;
  std::uint32_t base_ = 0;
  std::uint32_t length_ = 0xffffffffu;
};

}  // namespace tessera::laz
