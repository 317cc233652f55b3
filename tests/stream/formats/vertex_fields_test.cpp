#include "stream/formats/vertex_fields.h"

#include <catch2/catch.hpp>

namespace tessera::vertex_fields_test {

TEST_CASE("vertex fields: names are the same in capitals, parts of names are not", "[unit]") {
  CHECK(equal_any_case("Diffuse_Red", "diffuse_red"));
  CHECK(equal_any_case("X", "x"));
  CHECK_FALSE(equal_any_case("red", "redder"));
  CHECK_FALSE(equal_any_case("", "x"));
}

TEST_CASE("vertex fields: the scale of colours follows from their type and their largest component",
          "[unit]") {
  using Type = ScalarType;
  CHECK(colour_scale_for(Type::kUint8, 1) == ColourScale::kByte);
  CHECK(colour_scale_for(Type::kUint16, 255) == ColourScale::kByte);
  CHECK(colour_scale_for(Type::kUint16, 256) == ColourScale::kHighByte);
  CHECK(colour_scale_for(Type::kInt32, 65535) == ColourScale::kHighByte);
  CHECK(colour_scale_for(Type::kFloat32, 1) == ColourScale::kUnit);
  CHECK(colour_scale_for(Type::kFloat32, 255.5) == ColourScale::kByte);
  CHECK(colour_scale_for(Type::kFloat64, 65535) == ColourScale::kHighByte);
  CHECK(int{colour_byte(0.5, ColourScale::kUnit)} == 128);
  CHECK(int{colour_byte(65535, ColourScale::kHighByte)} == 255);
  CHECK(int{colour_byte(300, ColourScale::kByte)} == 255);
  CHECK(int{colour_byte(-1, ColourScale::kByte)} == 0);
}

}  // namespace tessera::vertex_fields_test
