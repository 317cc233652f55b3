#include "octree/vector.h"

#include <array>
#include <catch2/catch.hpp>
#include <type_traits>

namespace vector_lookup_test {

// Outside of the namespace: arguments lead to it.
TEST_CASE("vector: operators are found from outside of the namespace", "[unit]") {
  const tessera::Double3 a = {1, 2, 3}, b = {4, -5, 6};
  CHECK(-(a + b) * 2.0 == tessera::Double3{-10, 6, -18});
  CHECK((a - b) / 3.0 == tessera::Double3{-1, 7.0 / 3.0, -1});
  CHECK(norm(cross(a, b)) > 0.0);
}

TEST_CASE("vector: it is an array in all but its name", "[unit]") {
  static_assert(sizeof(tessera::Double3) == sizeof(std::array<double, 3>));
  static_assert(std::is_aggregate_v<tessera::Double3> && std::is_trivially_copyable_v<tessera::Double3> &&
                std::is_standard_layout_v<tessera::Double3>);
  const tessera::Double3 v = {1, 2, 3};
  const auto& [x, y, z] = v;
  CHECK(x + y + z == 6.0);
  const std::array<double, 3>& plain = v;
  CHECK(plain == v);
  CHECK(v < tessera::Double3{1, 2, 4});
  CHECK(tessera::Double3{plain} == v);
}

}  // namespace vector_lookup_test

namespace tessera::vector_test {

TEST_CASE("vector: products, lengths and normals of small numbers are exact", "[unit]") {
  const Double3 a = {1, 2, 3}, b = {4, -5, 6};
  CHECK(a + b == Double3{5, -3, 9});
  CHECK(a - b == Double3{-3, 7, -3});
  CHECK(-a == Double3{-1, -2, -3});
  CHECK(a * 2.0 == Double3{2, 4, 6});
  CHECK(a / 2.0 == Double3{0.5, 1, 1.5});
  CHECK(dot(a, b) == 12.0);
  CHECK(cross(a, b) == Double3{27, 6, -13});
  CHECK(norm(Double3{2, 3, 6}) == 7.0);
  CHECK(squared_distance(a, b) == 67.0);
  CHECK(unit(Double3{0, 0, -4}) == Double3{0, 0, -1});
  CHECK(unit_or_zero(Double3{}) == Double3{});
  CHECK(unit_or_zero(Float3{0, 8, 0}) == Float3{0, 1, 0});
  CHECK(triangle_normal<double>({0, 0, 0}, {2, 0, 0}, {0, 3, 0}) == Double3{0, 0, 6});
  CHECK(wide(narrow({0.5, -1, 1024})) == Double3{0.5, -1, 1024});
}

TEST_CASE("vector: there is a unit vector at right angles to any other", "[unit]") {
  for (const Double3& n : {Double3{1, 0, 0}, Double3{0, -1, 0}, Double3{0, 0, 1}, Double3{0.6, 0.8, 0},
                           Double3{0.48, 0.6, -0.64}}) {
    const Double3 o = any_orthogonal(n);
    CHECK(norm(o) == Approx(1.0));
    CHECK(dot(o, n) == Approx(0.0).margin(1e-15));
  }
}

}  // namespace tessera::vector_test
