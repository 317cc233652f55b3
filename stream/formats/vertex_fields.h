/// \file vertex_fields.h
/// What the fields of vertices and points are called in PLY, PCD and text, and what the numbers of their colours mean:
/// 0..1, 0..255 or 0..65535. One decision for scans and meshes.
#pragma once
#include <array>
#include <cstdint>
#include <string_view>

#include "stream/formats/scalar.h"

namespace tessera {

using FieldTriple = std::array<std::string_view, 3>;
inline constexpr FieldTriple kPositionFields = {"x", "y", "z"};
/// Most usual first; writers differ in capitals, see equal_any_case().
inline constexpr std::array kNormalFields = {FieldTriple{"nx", "ny", "nz"},
                                             FieldTriple{"normal_x", "normal_y", "normal_z"},
                                             FieldTriple{"normalx", "normaly", "normalz"}};
inline constexpr std::array kColourFields = {FieldTriple{"red", "green", "blue"}, FieldTriple{"r", "g", "b"},
                                             FieldTriple{"diffuse_red", "diffuse_green", "diffuse_blue"},
                                             FieldTriple{"rf", "gf", "bf"}};
inline constexpr std::array<std::string_view, 3> kIntensityFields = {"intensity", "scalar_intensity",
                                                                     "reflectance"};

/// Of the signed distance to a reference that `deviate` writes.
inline constexpr const char* kDeviationName = "deviation";

/// Whether two names are the same but for capitals (ASCII).
bool equal_any_case(std::string_view a, std::string_view b);

/// How a colour component becomes 0..255.
enum class ColourScale : std::uint8_t {
  kByte,      ///< as it is, clamped: 8 bits, also when stored in a wider type
  kHighByte,  ///< 16 bits; the high byte, exact for writers that multiply by 256 and for those by 257
  kUnit,      ///< 0..1
};

/// The scale of colours of this type whose largest sampled component is `largest`. Wider integers than 8 bits are bytes
/// unless one exceeds 255; floats are 0..1 unless one exceeds 1, and 16 bits where one exceeds 256.
ColourScale colour_scale_for(ScalarType type, double largest);

/// A component as 0..255, clamped; 0 for what is no number.
inline std::uint8_t colour_byte(double value, ColourScale scale) {
  if (scale == ColourScale::kHighByte) value *= 1.0 / 256;
  if (scale == ColourScale::kUnit) value = value * 255 + 0.5;
  if (!(value > 0)) return 0;  // also NaN
  return value >= 255 ? std::uint8_t{255} : static_cast<std::uint8_t>(value);
}

}  // namespace tessera
