// A scalar of PLY vertices, whatever the types and the order of bytes.
#include <catch2/catch.hpp>

#include <cstring>
#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/formats/ply_scalar.h"
#include "tests/helpers/temp_folder.h"

namespace ply_scalar_test {

using namespace tessera;
using namespace tessera::test;

namespace {

template <class T>
void put(std::string& to, T value, bool swap) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  to += swap ? std::string(bytes.rbegin(), bytes.rend()) : bytes;
}

std::string ply(bool big_endian, std::size_t vertices) {
  std::string text = std::string("ply\nformat binary_") + (big_endian ? "big" : "little") +
                     "_endian 1.0\nelement vertex " + std::to_string(vertices) +
                     "\nproperty float deviation\nproperty uchar red\nproperty double x\nproperty short y\n"
                     "property float z\nend_header\n";
  for (std::size_t i = 0; i < vertices; ++i) {
    put(text, 0.5f * static_cast<float>(i), big_endian), put(text, std::uint8_t{7}, big_endian);
    put(text, static_cast<double>(i) + 0.25, big_endian), put(text, std::int16_t{-3}, big_endian);
    put(text, 2.0f, big_endian);
  }
  return text;
}

}  // namespace

TEST_CASE("ply scalar: numbers and positions come in order, in either order of bytes", "[unit]") {
  const TempFolder folder;
  for (const bool big_endian : {false, true}) {
    const auto scalar = PlyScalar::open(folder.write("a.ply", ply(big_endian, 40000)), "deviation");
    REQUIRE(scalar);
    CHECK(scalar->count() == 40000);
    CHECK_FALSE(scalar->has_faces());
    std::size_t i = 0, wrong = 0;
    scalar->read([&](std::span<const Double3> positions, std::span<const double> values) {
      for (std::size_t k = 0; k < values.size(); ++k, ++i) {
        const auto at = static_cast<double>(i);
        wrong += positions[k] == Double3{at + 0.25, -3.0, 2.0} && values[k] == 0.5 * at ? 0 : 1;
      }
    });
    CHECK(i == 40000);
    CHECK(wrong == 0);
  }
}

TEST_CASE("ply scalar: none where there is none, and what is cut short is refused", "[unit]") {
  const TempFolder folder;
  CHECK_FALSE(PlyScalar::open(folder.write("a.ply", ply(false, 3)), "distance"));
  CHECK_FALSE(PlyScalar::open(folder.write("a.xyz", "0 0 0"), "deviation"));
  CHECK_FALSE(PlyScalar::open(
      folder.write("t.ply",
                   "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                   "property float z\nproperty float deviation\nend_header\n0 0 0 1\n"),
      "deviation"));
  const std::string whole = ply(false, 3);
  CHECK_THROWS_AS(PlyScalar::open(folder.write("b.ply", whole.substr(0, whole.size() - 1)), "deviation"),
                  InputError);
  std::string lie = whole;
  lie.replace(lie.find("vertex 3"), 8, "vertex 18446744073709551615");
  CHECK_THROWS_AS(PlyScalar::open(folder.write("c.ply", lie), "deviation"), InputError);
}

}  // namespace ply_scalar_test
