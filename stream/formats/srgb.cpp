#include "stream/formats/srgb.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

double linear_of(double srgb) {
  const double above = (srgb + 0.055) / 1.055;
  double root = 1.0;  // the fifth one of above squared, by Newton: the same on every machine
  for (int step = 0; step < 40; ++step) root -= (root - above * above / (root * root * root * root)) / 5.0;
  return srgb <= 0.04045 ? srgb / 12.92 : above * above * root;
}

std::array<std::uint16_t, 256> linear_table() {
  std::array<std::uint16_t, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i)
    table[i] = static_cast<std::uint16_t>(std::lround(65535.0 * linear_of(static_cast<double>(i) / 255.0)));
  return table;
}

/// Where the nearest channel changes: linear values half-way, as sRGB counts, between one channel and the next.
std::array<double, 255> thresholds() {
  std::array<double, 255> table{};
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = linear_of((static_cast<double>(i) + 0.5) / 255.0);
  return table;
}

}  // namespace

std::uint16_t linear_from_srgb(std::uint8_t channel) {
  static const std::array<std::uint16_t, 256> table = linear_table();
  return table[channel];
}

std::uint8_t srgb_from_linear(double linear) {
  static const std::array<double, 255> steps = thresholds();
  if (!(linear > 0.0)) return 0;
  return static_cast<std::uint8_t>(std::upper_bound(steps.begin(), steps.end(), linear) - steps.begin());
}

std::array<std::uint16_t, 4> linear_from_rgba(std::uint32_t rgba) {
  const auto linear = [&](int shift) { return linear_from_srgb(static_cast<std::uint8_t>(rgba >> shift)); };
  return {linear(0), linear(8), linear(16), static_cast<std::uint16_t>((rgba >> 24) * 257)};
}

}  // namespace tessera
