#include "stream/formats/laz/arithmetic_encoder.h"

namespace tessera::laz {

namespace {
constexpr std::uint32_t kMinLength = 1u << 24;
}

unsigned ArithmeticEncoder::symbol(SymbolModel& model, unsigned value) {
  model.prepare();
  const std::uint32_t whole = length_;
  length_ >>= SymbolModel::kShareBits;
  const std::uint32_t begin = model.before(value) * length_;
  const std::uint32_t end = value + 1 < model.symbols() ? model.before(value + 1) * length_ : whole;
  length_ = end - begin;
  advance(begin);
  model.count(value);
  return value;
}

unsigned ArithmeticEncoder::bit(BitModel& model, unsigned value) {
  const std::uint32_t zero = model.zero_share() * (length_ >> BitModel::kShareBits);
  length_ = value == 0 ? zero : length_ - zero;
  advance(value == 0 ? 0 : zero);
  model.count(value);
  return value;
}

std::uint32_t ArithmeticEncoder::raw(unsigned bits, std::uint32_t value) {
  if (bits <= 19) {
    raw_few(bits, value);
  } else {
    raw_few(16, value & 0xffffu);
    raw_few(bits - 16, value >> 16);
  }
  return value;
}

void ArithmeticEncoder::raw_few(unsigned bits, std::uint32_t value) {
  length_ >>= bits;
  advance(value * length_);
}

void ArithmeticEncoder::advance(std::uint32_t by) {
  base_ += by;
  if (base_ < by) {  // the carry runs through all bytes of ones
    for (std::size_t i = bytes_.size(); ++bytes_[--i] == 0;) {
    }
  }
  renormalise();
}

void ArithmeticEncoder::renormalise() {
  for (; length_ < kMinLength; length_ <<= 8) {
    bytes_.push_back(static_cast<char>(base_ >> 24));
    base_ <<= 8;
  }
}

void ArithmeticEncoder::finish() {
  // One byte or two end the code, zeros make up the four that a decoder is ahead.
  const bool one = length_ > 2 * kMinLength;
  length_ = one ? kMinLength >> 1 : kMinLength >> 9;
  advance(one ? kMinLength : kMinLength >> 1);
  bytes_.insert(bytes_.end(), one ? 3 : 2, '\0');
}

}  // namespace tessera::laz
