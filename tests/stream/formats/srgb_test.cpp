#include "stream/formats/srgb.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <limits>

namespace srgb_test {

using namespace tessera;

TEST_CASE("srgb: all 256 channels come back from 16 linear bits and from floats", "[unit]") {
  for (int c = 0; c < 256; ++c) {
    CAPTURE(c);
    const auto channel = static_cast<std::uint8_t>(c);
    const std::uint16_t linear = linear_from_srgb(channel);
    CHECK(srgb_from_linear(linear / 65535.0) == channel);
    CHECK(srgb_from_linear(static_cast<double>(static_cast<float>(linear / 65535.0))) == channel);
    // IEC 61966-2-1 as it is written
    const double s = c / 255.0, exact = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    CHECK(std::fabs(linear - 65535.0 * exact) <= 0.5 + 1e-6);
  }
  CHECK(linear_from_rgba(0x80ff0060u) == std::array<std::uint16_t, 4>{7666, 0, 65535, 0x8080});
}

TEST_CASE("srgb: linear values take the nearest channel, and the end beyond it", "[unit]") {
  for (int i = 0; i <= 20000; ++i) {
    const double linear = i / 20000.0;
    const double s = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
    REQUIRE(std::fabs(srgb_from_linear(linear) - 255.0 * s) <= 0.5 + 0.01);
  }
  CHECK(srgb_from_linear(-1.0) == 0);
  CHECK(srgb_from_linear(7.0) == 255);
  CHECK(srgb_from_linear(std::numeric_limits<double>::infinity()) == 255);
  CHECK(srgb_from_linear(std::numeric_limits<double>::quiet_NaN()) == 0);
}

}  // namespace srgb_test
