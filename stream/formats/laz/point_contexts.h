/// \file point_contexts.h
/// What the points before tell about the next one: the middle of recent steps, and contexts from return numbers.
/// Source: ASPRS LAZ specification 1.4 (POINT10 version 2, POINT14).
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>

namespace tessera::laz {

/// Middle of five values, of which every new one drives out the largest or the smallest in turn of where it falls.
class StreamingMedian {
 public:
  std::int32_t middle() const { return values_[2]; }
  void add(std::int32_t v) {
    const std::array<std::int32_t, 5> a = values_;
    const std::size_t keep = drops_largest_ ? 0 : 1;
    values_[0] = std::min(a[keep], v);
    for (std::size_t i = 1; i < 4; ++i) values_[i] = std::max(a[keep + i - 1], std::min(a[keep + i], v));
    values_[4] = std::max(a[keep + 3], v);
    drops_largest_ = drops_largest_ ? v < a[2] : v <= a[2];
  }

 private:
  std::array<std::int32_t, 5> values_{};  ///< ascending
  bool drops_largest_ = true;
};

/// Return number and number of returns as one of 16 (three bits each).
inline unsigned return_context_16(unsigned number, unsigned of) {
  static constexpr std::uint8_t kMap[8][8] = {
      {15, 14, 13, 12, 11, 10, 9, 8},  {14, 0, 1, 3, 6, 10, 10, 9},    {13, 1, 2, 4, 7, 11, 11, 10},
      {12, 3, 4, 5, 8, 12, 12, 11},    {11, 6, 7, 8, 9, 13, 13, 12},   {10, 10, 11, 12, 13, 14, 14, 13},
      {9, 10, 11, 12, 13, 14, 15, 14}, {8, 9, 10, 11, 12, 13, 14, 15},
  };
  return kMap[of][number];
}

/// The same as one of 6 (four bits each); symmetric.
inline unsigned return_context_6(unsigned number, unsigned of) {
  static constexpr const char* kMap[16] = {
      "0123453445555555", "1013333333333333", "2124444444433333", "3345444444444444",
      "4344544444444444", "5344454444444444", "3344445444444444", "4344444544444444",
      "4344444454444444", "5344444445444444", "5344444444544444", "5334444444455444",
      "5334444444455544", "5334444444445554", "5334444444444555", "5334444444444455",
  };
  return static_cast<unsigned>(kMap[of][number] - '0');
}

/// Returns that lie between this one and the last: one of 8.
inline unsigned return_level(unsigned number, unsigned of) {
  return std::min(number < of ? of - number : number - of, 7u);
}

/// Contexts of y and z from the length of the steps before.
inline unsigned even_up_to(unsigned length, unsigned maximum) {
  return length < maximum ? length & ~1u : maximum;
}

}  // namespace tessera::laz
