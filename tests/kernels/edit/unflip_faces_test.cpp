// Faces that a pose turned over come upright; nothing else moves.
#include "kernels/edit/unflip_faces.h"

#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "octree/placement.h"
#include "tests/helpers/surfaces.h"

namespace unflip_faces_test {

using namespace tessera;
using namespace tessera::test;

namespace {

/// A bumpy sheet whose border is held, all of it turned and moved.
struct Sheet {
  Surface at_rest = height_grid(20, 20.0, [](double x, double y) { return 0.3 * std::sin(x) * std::cos(y); });
  Placement to = rotation({0, 0, 1}, 70.0).after(rotation({1, 0, 0}, 110.0));
  std::vector<std::uint8_t> free;
  std::vector<Rotation> rotations;
  std::vector<Double3> wanted;
  Sheet() {
    to.shift = {5, 6, 7};
    for (const Double3& p : at_rest.position) {
      free.push_back(p[0] > 0 && p[0] < 20 && p[1] > 0 && p[1] < 20);
      rotations.push_back(to.matrix);
      wanted.push_back(to.apply(p));
    }
  }
  RotatedBase base() const { return {at_rest.position, at_rest.faces, free, rotations}; }
};

constexpr std::size_t kMiddle = 10 * 21 + 10;

}  // namespace

TEST_CASE("upright faces: a base that only turns stays as it is", "[unit]") {
  const Sheet s;
  std::vector<Double3> posed = s.wanted;
  CHECK(flipped_faces(s.base(), posed).empty());
  CHECK(unflip(s.base(), posed).left == 0);
  CHECK(posed == s.wanted);
}

TEST_CASE("upright faces: a fold comes out, and what is far from it keeps its bits", "[unit]") {
  const Sheet s;
  std::vector<Double3> posed = s.wanted;
  posed[kMiddle] = s.to.apply({12.3, 10.2, 0.0});  // over its neighbours
  const std::vector<std::uint32_t> flipped = flipped_faces(s.base(), posed);
  REQUIRE_FALSE(flipped.empty());
  for (const std::uint32_t j : flipped) {
    const auto& f = s.at_rest.faces[j];
    CHECK((f[0] == kMiddle || f[1] == kMiddle || f[2] == kMiddle));
  }
  CHECK(unflip(s.base(), posed).left == 0);
  CHECK(flipped_faces(s.base(), posed).empty());
  for (std::size_t v = 0; v < posed.size(); ++v) {
    const Double3& p = s.at_rest.position[v];
    if (std::fabs(p[0] - 10) > 4 || std::fabs(p[1] - 10) > 4)
      CHECK(posed[v] == s.wanted[v]);
    else
      CHECK(norm(posed[v] - s.wanted[v]) < 0.05);
  }
}

TEST_CASE("upright faces: what is pressed together to next to nothing stays pressed", "[unit]") {
  const Sheet s;
  // Three columns of squares, flat now, become a hundredth as wide; one vertex is beyond its neighbour there.
  std::vector<Double3> posed;
  for (std::size_t v = 0; v < s.at_rest.position.size(); ++v) {
    Double3 p = s.at_rest.position[v];
    const double in = std::clamp(p[0] - 9.0, 0.0, 3.0);
    if (p[0] > 7.0 && p[0] < 14.0) p[2] = 0.0;
    p[0] -= 0.99 * in;
    if (v == kMiddle) p[0] += 0.012;
    posed.push_back(s.to.apply(p));
  }
  const RotatedBase base = s.base();
  const std::vector<Double3> given = posed;
  REQUIRE_FALSE(flipped_faces(base, posed).empty());
  CHECK(unflip(base, posed).left == 0);
  CHECK(flipped_faces(base, posed).empty());
  // Relaxed, all of it would go back towards its width: by a whole edge.
  double far = 0.0;
  for (std::size_t v = 0; v < posed.size(); ++v) far = std::max(far, norm(posed[v] - given[v]));
  CHECK(far > 0.0);
  CHECK(far < 0.1);
}

TEST_CASE("upright faces: lifted alone, a fold that wants more than a tenth of an edge stays", "[unit]") {
  const Sheet s;
  std::vector<Double3> posed = s.wanted;
  posed[kMiddle] = s.to.apply({12.3, 10.2, 0.0});
  const std::vector<Double3> given = posed;
  const UnflipReport report = lift_flipped(s.base(), posed);
  CHECK(report.before == flipped_faces(s.base(), given).size());
  CHECK(report.left == flipped_faces(s.base(), posed).size());
  CHECK(report.left > 0);
  for (std::size_t v = 0; v < posed.size(); ++v) CHECK(norm(posed[v] - given[v]) < 0.11);
}

TEST_CASE("upright faces: what is held folds what nothing can unfold, and is counted", "[unit]") {
  Sheet s;
  std::vector<Double3> posed = s.wanted;
  // The border goes through the middle: a line of faces must turn over.
  for (std::size_t v = 0; v < posed.size(); ++v)
    if (s.at_rest.position[v][0] == 0.0) posed[v] = s.to.apply(s.at_rest.position[v] + Double3{30, 0, 0});
  const std::vector<Double3> before = posed;
  const std::size_t folded = flipped_faces(s.base(), posed).size();
  const UnflipReport report = unflip(s.base(), posed);
  CHECK(report.before == folded);
  CHECK(report.left > 0);
  CHECK(report.left == flipped_faces(s.base(), posed).size());
  for (std::size_t v = 0; v < posed.size(); ++v)
    if (!s.free[v]) CHECK(posed[v] == before[v]);
}

TEST_CASE("upright faces: how a surface turned is fitted, wherever its details come from", "[unit]") {
  const Sheet s;
  double worst = 0.0;
  for (const Rotation& rotation : fitted_rotations(s.at_rest.position, s.wanted, s.at_rest.faces))
    for (std::size_t k = 0; k < 9; ++k) worst = std::max(worst, std::fabs(rotation[k] - s.to.matrix[k]));
  CHECK(worst < 1e-9);
}

TEST_CASE("upright faces: a pose goes towards another one around what is turned over, and no farther",
          "[unit]") {
  const Sheet s;
  std::vector<Double3> posed = s.wanted, other = s.wanted;
  for (std::size_t v = 0; v < other.size(); ++v)
    if (s.free[v]) other[v] = other[v] + Double3{0, 0, 1e-3};
  posed[kMiddle] = s.to.apply({12.3, 10.2, 0.0});  // over its neighbours
  const std::size_t flipped = flipped_faces(s.base(), posed).size();
  REQUIRE(flipped > 0);
  CHECK(yield_to(s.base(), other, flipped, posed) == 0);
  CHECK(flipped_faces(s.base(), posed).empty());
  std::size_t moved = 0;
  for (std::size_t v = 0; v < posed.size(); ++v) moved += posed[v] != s.wanted[v];
  CHECK(moved > 1);
  CHECK(moved < 40);
}

}  // namespace unflip_faces_test
