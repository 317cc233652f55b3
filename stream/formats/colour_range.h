/// \file colour_range.h
/// The range of a mesh's colours, by those of its first vertices: 0..1, 0..255 or 0..65535 (vertex_fields.h).
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "stream/formats/vertex_fields.h"

namespace tessera {

class ColourRange {
 public:
  static constexpr std::uint64_t kRows = 10000;  ///< vertices looked at

  /// \param type  that the file declares; text has floats
  explicit ColourRange(ScalarType type = ScalarType::kFloat64) : type_(type) { set_scale(); }
  /// A component of one of the first vertices.
  void add(double component) {
    if (!(component > largest_)) return;
    largest_ = component;
    set_scale();
  }
  /// Of 16 bits the nearest byte, not the high one: meshes scale 0..1 by 65535.
  std::uint32_t byte(double component) const {
    return scale_ == ColourScale::kHighByte ? colour_byte(component / 65535.0, ColourScale::kUnit)
                                            : colour_byte(component, scale_);
  }
  /// Of an alpha that is not given.
  double opaque() const { return kFull[static_cast<std::size_t>(scale_)]; }
  /// One sentence where the values decided other than the type alone, else empty.
  std::string note() const {
    const bool by_type = scalar_is_float(type_)         ? scale_ == ColourScale::kUnit
                         : type_ == ScalarType::kUint16 ? scale_ == ColourScale::kHighByte
                                                        : scale_ == ColourScale::kByte;
    if (by_type) return {};
    return std::string("colours are taken as 0 to ") + (scale_ == ColourScale::kByte ? "255" : "65535") +
           ", by those of the first " + std::to_string(kRows) + " vertices";
  }

 private:
  // Averages and filters overshoot 1 a little: that is no range of bytes.
  static constexpr double kOvershoot = 1.5;
  static constexpr std::array<double, 3> kFull = {255.0, 65535.0, 1.0};
  void set_scale() {
    const bool unit = scalar_is_float(type_) && largest_ <= kOvershoot;
    scale_ = colour_scale_for(type_, unit ? std::min(largest_, 1.0) : largest_);
  }

  ScalarType type_;
  double largest_ = 0.0;
  ColourScale scale_ = ColourScale::kByte;
};

/// "left out: texture coordinates, materials", for warnings(); nothing for nothing.
inline std::vector<std::string> list_left_out(const std::vector<std::string>& names) {
  if (names.empty()) return {};
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "left out: " : ", ") + name;
  return {text};
}

}  // namespace tessera
