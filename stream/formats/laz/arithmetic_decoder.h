/// \file arithmetic_decoder.h
/// Symbols, bits and raw numbers out of arithmetically coded bytes. Items are described once for both ways: what they
/// hand over to be coded, a decoder ignores and answers with what was. Source: Said, FastAC; ASPRS LAZ specification.
#pragma once
#include <bit>
#include <cstdint>

#include "stream/formats/laz/byte_feed.h"
#include "stream/formats/laz/symbol_model.h"

namespace tessera::laz {

class ArithmeticDecoder {
 public:
  static constexpr bool kEncodes = false;

  /// Takes the first four bytes. \throws Damage (as all that follows) for bytes that nothing codes, EndOfBytes
  void start(ByteFeed& feed) {
    feed_ = &feed;
    length_ = 0xffffffffu;
    value_ = 0;
    for (int i = 0; i < 4; ++i) value_ = value_ << 8 | feed.next();
    if (value_ == length_) refuse();
  }

  unsigned symbol(SymbolModel& model, unsigned /*coded*/ = 0) {
    model.prepare();
    const std::uint32_t whole = length_;
    length_ >>= SymbolModel::kShareBits;
    const std::uint32_t share = value_ / length_;
    const unsigned found = model.find(share < kMaxShare ? share : kMaxShare);
    const std::uint32_t begin = model.before(found) * length_;
    const std::uint32_t end = found + 1 < model.symbols() ? model.before(found + 1) * length_ : whole;
    value_ -= begin;
    length_ = end - begin;
    renormalise();
    model.count(found);
    return found;
  }

  unsigned bit(BitModel& model, unsigned /*coded*/ = 0) {
    const std::uint32_t zero = model.zero_share() * (length_ >> BitModel::kShareBits);
    const unsigned found = value_ >= zero ? 1 : 0;
    if (found == 0) {
      length_ = zero;
    } else {
      value_ -= zero;
      length_ -= zero;
    }
    renormalise();
    model.count(found);
    return found;
  }

  /// \pre  1 <= bits <= 32
  std::uint32_t raw(unsigned bits, std::uint32_t /*coded*/ = 0) {
    if (bits <= kMaxRawBits) return raw_few(bits);
    const std::uint32_t low = raw_few(16);
    return raw_few(bits - 16) << 16 | low;
  }

 private:
  static constexpr std::uint32_t kMaxShare = (1u << SymbolModel::kShareBits) - 1;
  static constexpr unsigned kMaxRawBits = 19;

  std::uint32_t raw_few(unsigned bits) {
    length_ >>= bits;
    const std::uint32_t found = value_ / length_;
    if (found >> bits != 0) refuse();
    value_ -= length_ * found;
    renormalise();
    return found;
  }

  /// Brings the length back above 2^24, a byte at a time or all bytes at once.
  void renormalise() {
    std::uint32_t four;
    if (feed_->ahead(four)) [[likely]] {
      const unsigned bytes = static_cast<unsigned>(std::countl_zero(length_)) / 8;
      value_ = static_cast<std::uint32_t>(((std::uint64_t{value_} << 32 | four) << (8 * bytes)) >> 32);
      length_ <<= 8 * bytes;
      feed_->skip_ahead(bytes);
      return;
    }
    for (; length_ < 1u << 24; length_ <<= 8) value_ = value_ << 8 | feed_->next();
  }
  [[noreturn]] static void refuse() { throw Damage("its bytes are no coded points"); }

  ByteFeed* feed_ = nullptr;
  std::uint32_t value_ = 0;   ///< less than length_
  std::uint32_t length_ = 0;  ///< of the interval left
};

}  // namespace tessera::laz
