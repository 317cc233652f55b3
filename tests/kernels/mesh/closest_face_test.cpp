#include "kernels/mesh/closest_face.h"

#include <catch2/catch.hpp>

#include <cmath>
#include <vector>

#include "tests/helpers/random.h"

namespace closest_face_test {

namespace {

using namespace tessera;
using Face = std::array<std::uint32_t, 3>;

struct Faces {
  std::vector<Double3> position;
  std::vector<Face> faces;

  std::uint32_t add(const Double3& p) {
    position.push_back(p);
    return static_cast<std::uint32_t>(position.size() - 1);
  }
};

/// Fans of needles from a few points at one end of a rail to points all along it, and a patch of round faces.
Faces needles_along_a_rail(int count, test::Random& random) {
  Faces out;
  const auto rail = [](double t) { return Double3{9000.0 * t, 16000.0 * std::sqrt(t), 400.0 * t}; };
  std::vector<std::uint32_t> along;
  for (int i = 0; i <= count; ++i) {
    Double3 p = rail(static_cast<double>(i) / count);
    p[2] += i % 2;
    along.push_back(out.add(p));
  }
  for (int hub = 0; hub < 3; ++hub) {
    const std::uint32_t h = out.add(rail(0.001 * hub) + Double3{0.3, -0.2, 0.5});
    for (std::size_t i = 1; i < along.size(); ++i) out.faces.push_back({h, along[i - 1], along[i]});
  }
  for (int i = 0; i < 200; ++i) {
    const Double3 p = rail(random.unit());
    const std::uint32_t a = out.add(p), b = out.add(p + Double3{1, 0, 0}), c = out.add(p + Double3{0, 1, 0});
    out.faces.push_back({a, b, c});
  }
  out.faces.push_back({0, along.back(), along.back()});  // a segment
  return out;
}

/// Of all triangles, one by one.
ClosestFaces::Hit searched(const ClosestFaces& closest, const Double3& p, double limit) {
  ClosestFaces::Hit best{limit, ClosestFaces::kNone};
  for (std::uint32_t slot = 0; slot < closest.size(); ++slot) {
    const double square = closest.square_to(slot, p);
    if (square < best.square || (square == best.square && best.slot != ClosestFaces::kNone &&
                                 closest.face(slot) < closest.face(best.slot)))
      best = {square, slot};
  }
  return best;
}

}  // namespace

TEST_CASE("closest face: among long needles and round faces it is the one that a search of all finds",
          "[property]") {
  test::Random random(7);
  // Many needles; needles alone; fewer than fill a leaf; round faces alone; all of them at one place.
  for (const auto& [needles, keep] :
       {std::pair(400, 1201), std::pair(400, 1000), std::pair(1, 3), std::pair(1, 204), std::pair(1, 0)}) {
    Faces made = needles_along_a_rail(needles, random);
    if (keep == 0)
      made.faces.assign(100, made.faces[100]);
    else if (static_cast<std::size_t>(keep) < made.faces.size())
      made.faces.resize(static_cast<std::size_t>(keep));
    const Double3 origin = made.position.front();
    const ClosestFaces closest(made.position, made.faces, origin);
    REQUIRE(closest.size() == made.faces.size());
    for (int i = 0; i < 400; ++i) {
      CAPTURE(needles, keep, i);
      const Face& f = made.faces[random.below(made.faces.size())];
      const double s = random.unit(), off = i % 3 == 0 ? 100.0 : 0.01;
      Double3 p = made.position[f[0]] * (1.0 - s) + made.position[f[1]] * s - origin;
      for (double& c : p) c += random.in(-off, off);
      const double limit = i % 2 == 0 ? 1e300 : 0.0004;
      const ClosestFaces::Hit want = searched(closest, p, limit),
                              got = closest.closest(p, limit, ClosestFaces::kNone);
      CHECK(got.square == want.square);
      CHECK((want.slot == ClosestFaces::kNone ? got.slot == want.slot
                                              : closest.face(got.slot) == closest.face(want.slot)));
    }
  }
}

}  // namespace closest_face_test
