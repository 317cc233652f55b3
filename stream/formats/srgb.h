/// \file srgb.h
/// Colours between sRGB, in which scans, screens and most mesh files hold them, and the linear light that glTF asks for
/// (glTF 2.0, section 3.7.2.1). Source: IEC 61966-2-1. The same on every machine: no pow.
#pragma once
#include <array>
#include <cstdint>

namespace tessera {

/// The linear value of an sRGB channel, 65535 for 1. Sixteen bits: in eight, the 61 darkest would become 13.
std::uint16_t linear_from_srgb(std::uint8_t channel);

/// The sRGB channel nearest to a linear value, as the eye sees it; what lies outside of [0, 1] takes the end, and what is
/// not a number is 0. Undoes linear_from_srgb() / 65535.
std::uint8_t srgb_from_linear(double linear);

/// A colour as glTF stores it, in 16 bits a channel; alpha is linear in both.
std::array<std::uint16_t, 4> linear_from_rgba(std::uint32_t rgba);

}  // namespace tessera
