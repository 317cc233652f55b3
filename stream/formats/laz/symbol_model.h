/// \file symbol_model.h
/// Adaptive probabilities of symbols and of bits, as decoder and encoder keep them alike. Sources: Said, Introduction
/// to Arithmetic Coding (FastAC); ASPRS LAZ specification 1.4, annex on entropy coding.
#pragma once
#include <immintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <memory>

namespace tessera::laz {

/// Shares of 2^15 for up to 2048 symbols, updated ever more rarely. Memory is taken when it is first used: most models
/// of a chunk never are.
class SymbolModel {
 public:
  static constexpr unsigned kShareBits = 15;
  /// Cumulative shares stand in blocks of so many, the first of each block once more in front: a search compares one
  /// block of either, without branches.
  static constexpr unsigned kBlock = 16;

  explicit SymbolModel(unsigned symbols = 0) : symbols_(static_cast<std::uint16_t>(symbols)) {}

  unsigned symbols() const { return symbols_; }
  /// Before every use.
  void prepare() {
    if (!memory_) [[unlikely]]
      reset();
  }
  /// The symbol whose share holds `share`. \pre  share < 2^15
  unsigned find(unsigned share) const {
    const __m256i wanted = _mm256_set1_epi16(static_cast<std::int16_t>(share));
    unsigned block = 0;
    if (symbols_ > kBlock) {
      unsigned begun = at_most(front_, wanted);
      for (unsigned f = 1; f < fronts_; ++f) begun += at_most(front_ + f * kBlock, wanted);
      block = std::min<unsigned>(begun, blocks_) - 1;
    }
    const unsigned symbol = block * kBlock + at_most(cumulative_ + block * kBlock, wanted) - 1;
    return std::min<unsigned>(symbol, symbols_ - 1u);
  }
  /// Sum of the shares of all symbols before this one.
  unsigned before(unsigned symbol) const { return cumulative_[symbol]; }
  void count(unsigned symbol) {
    ++counts_[symbol];
    if (--until_update_ == 0) update();
  }

 private:
  /// How many of a block's ascending shares are at most `share`. The padding equals the largest share there is: find()
  /// takes care not to answer with it.
  static unsigned at_most(const std::uint16_t* block, __m256i share) {
    const __m256i values = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(block));
    const auto above = static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_cmpgt_epi16(values, share)));
    return kBlock - static_cast<unsigned>(std::popcount(above)) / 2;
  }
  void reset();
  void update();

  std::uint16_t symbols_;
  std::uint16_t until_update_ = 0;
  std::uint16_t cycle_ = 0;
  std::uint16_t blocks_ = 0;
  std::uint16_t fronts_ = 0;  ///< blocks of `front_`
  std::uint32_t total_ = 0;
  std::unique_ptr<std::uint16_t[]> memory_;
  std::uint16_t* front_ = nullptr;       ///< first cumulative share of every block
  std::uint16_t* cumulative_ = nullptr;  ///< padded with 2^15 - 1 beyond the last symbol
  std::uint16_t* counts_ = nullptr;
};

/// Probability of a zero bit, of 2^13.
class BitModel {
 public:
  static constexpr unsigned kShareBits = 13;
  unsigned zero_share() const { return zero_share_; }
  void count(unsigned bit) {
    zeros_ += 1 - bit;
    if (--until_update_ == 0) update();
  }

 private:
  void update();

  std::uint32_t zeros_ = 1;
  std::uint32_t total_ = 2;
  std::uint32_t zero_share_ = 1u << (kShareBits - 1);
  std::uint32_t cycle_ = 4;
  std::uint32_t until_update_ = 4;
};

/// Models of one size, chosen by a context.
template <unsigned kContexts, unsigned kSymbols>
class ModelSet {
 public:
  ModelSet() {
    for (SymbolModel& m : models_) m = SymbolModel(kSymbols);
  }
  SymbolModel& operator[](std::size_t context) { return models_[context]; }

 private:
  std::array<SymbolModel, kContexts> models_;
};

}  // namespace tessera::laz
