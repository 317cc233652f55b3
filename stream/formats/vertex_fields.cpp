#include "stream/formats/vertex_fields.h"

#include <algorithm>

namespace tessera {

namespace {

constexpr char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

}  // namespace

bool equal_any_case(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](char p, char q) { return lower(p) == lower(q); });
}

ColourScale colour_scale_for(ScalarType type, double largest) {
  // Floats that were bytes may have been scaled and rounded to just above 255.
  if (scalar_is_float(type))
    return largest > 256 ? ColourScale::kHighByte : largest > 1 ? ColourScale::kByte : ColourScale::kUnit;
  if (scalar_bytes(type) == 1) return ColourScale::kByte;
  return largest > 255 ? ColourScale::kHighByte : ColourScale::kByte;
}

}  // namespace tessera
