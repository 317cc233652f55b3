// The share of a surface's area that long thin faces have.
#include "kernels/edit/thin_faces.h"

#include <catch2/catch.hpp>
#include <vector>

namespace thin_faces_test {

using namespace tessera;

TEST_CASE("thin faces: by area, over all that was added", "[unit]") {
  const std::vector<Double3> p = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {20, 0, 0}, {5, 5, 5}};
  const std::vector<std::array<std::uint32_t, 3>> even = {{0, 1, 2}}, thin = {{0, 3, 2}}, flat = {{4, 4, 4}};
  ThinArea area;
  CHECK(area.share() == 0.0);
  area.add(p, even);
  area.add(p, flat);
  CHECK(area.share() == 0.0);
  area.add(p, thin);
  CHECK(area.share() == Approx(20.0 / 21.0));
}

}  // namespace thin_faces_test
