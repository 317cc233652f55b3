#include "stream/formats/laz/symbol_model.h"

#include <algorithm>

namespace tessera::laz {

namespace {

constexpr std::uint32_t kMaxTotal = 1u << SymbolModel::kShareBits;
constexpr std::uint16_t kBeyond = kMaxTotal - 1;

unsigned blocks(unsigned n) {
  return (n + SymbolModel::kBlock - 1) / SymbolModel::kBlock;
}

}  // namespace

void SymbolModel::reset() {
  blocks_ = static_cast<std::uint16_t>(blocks(symbols_));
  fronts_ = static_cast<std::uint16_t>(blocks(blocks_));
  const unsigned padded = blocks_ * kBlock;
  memory_ = std::make_unique<std::uint16_t[]>(fronts_ * kBlock + 2 * padded);
  front_ = memory_.get();
  cumulative_ = front_ + fronts_ * kBlock;
  counts_ = cumulative_ + padded;
  std::fill(front_, counts_, kBeyond);
  std::fill(counts_, counts_ + symbols_, std::uint16_t{1});
  total_ = 0;
  cycle_ = symbols_;
  update();
  cycle_ = until_update_ = static_cast<std::uint16_t>((symbols_ + 6) / 2);
}

void SymbolModel::update() {
  total_ += cycle_;
  if (total_ > kMaxTotal) {
    total_ = 0;
    for (unsigned k = 0; k < symbols_; ++k) {
      counts_[k] = static_cast<std::uint16_t>((counts_[k] + 1) / 2);
      total_ += counts_[k];
    }
  }
  const std::uint32_t scale = 0x80000000u / total_;
  std::uint32_t sum = 0;
  for (unsigned k = 0; k < symbols_; ++k) {
    cumulative_[k] = static_cast<std::uint16_t>((scale * sum) >> (31 - kShareBits));
    sum += counts_[k];
  }
  for (unsigned b = 0; b < blocks_; ++b) front_[b] = cumulative_[b * kBlock];
  cycle_ = static_cast<std::uint16_t>(std::min(5u * cycle_ / 4, (symbols_ + 6u) * 8));
  until_update_ = cycle_;
}

void BitModel::update() {
  total_ += cycle_;
  if (total_ > 1u << kShareBits) {
    total_ = (total_ + 1) / 2;
    zeros_ = (zeros_ + 1) / 2;
    if (zeros_ == total_) ++total_;
  }
  const std::uint32_t scale = 0x80000000u / total_;
  zero_share_ = (zeros_ * scale) >> (31 - kShareBits);
  cycle_ = std::min(5 * cycle_ / 4, 64u);
  until_update_ = cycle_;
}

}  // namespace tessera::laz
