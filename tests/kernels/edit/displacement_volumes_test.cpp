// Prisms keep their volumes in a pose, and what vectors fold over does not fold (thesis, figure 5.8).
#include "kernels/edit/displacement_volumes.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/helpers/random.h"

namespace {

using namespace tessera;
using namespace tessera::test;

constexpr double kPi = 3.14159265358979323846;

/// A body along x over a thin tube that it leaves and comes back to at the ends; bent, each over an arc.
struct Tube {
  std::vector<Double3> base, surface, posed_base, posed_surface;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint8_t> free;
};

Tube tube(double length, double angle, bool square) {
  constexpr int kAround = 48, kAlong = 60;
  Tube t;
  const double radius = length / angle;
  for (int i = 0; i <= kAlong; ++i)
    for (int j = 0; j < kAround; ++j) {
      const double x = length * i / kAlong, at = 2.0 * kPi * (j + 0.5 * (i % 2)) / kAround;
      const double c = std::cos(at), s = std::sin(at),
                   r = square ? 0.9 / std::max(std::fabs(c), std::fabs(s)) : 1.0;
      const auto put = [&](double reach, std::vector<Double3>& still, std::vector<Double3>& bent) {
        still.push_back({x, reach * c, reach * s});
        const double turn = x / radius, across = radius - reach * c;
        bent.push_back({across * std::sin(turn), radius - across * std::cos(turn), reach * s});
      };
      put(0.2, t.base, t.posed_base);
      put(0.2 + (r - 0.2) * std::sin(kPi * i / kAlong), t.surface, t.posed_surface);
      t.free.push_back(i > 0 && i < kAlong);
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * kAround + j % kAround); };
  for (int i = 0; i < kAlong; ++i)
    for (int j = 0; j < kAround; ++j) {
      if (i % 2 == 0) {
        t.faces.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        t.faces.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
      } else {
        t.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        t.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  for (auto& f : t.faces) std::swap(f[1], f[2]);
  return t;
}

/// Faces whose outer side looks at their base.
std::size_t folded(const Tube& t, const std::vector<Double3>& surface) {
  std::size_t count = 0;
  for (const auto& f : t.faces) {
    const Double3 top = triangle_normal(surface[f[0]], surface[f[1]], surface[f[2]]),
                  base = triangle_normal(t.posed_base[f[0]], t.posed_base[f[1]], t.posed_base[f[2]]);
    count += dot(top, base) <= 0.0;
  }
  return count;
}

}  // namespace

TEST_CASE("displacement volumes: the volume of a prism", "[unit]") {
  const std::array<Double3, 3> base = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
  std::array<Double3, 3> top = base;
  for (Double3& p : top) p[2] = 3.0;
  CHECK(prism_volume(base, top) == Approx(1.5));
  for (Double3& p : top) p[0] += 7.0;  // sheared
  CHECK(prism_volume(base, top) == Approx(1.5));
  for (Double3& p : top) p[2] = -3.0;
  CHECK(prism_volume(base, top) == Approx(-1.5));
  // Neighbours add up: their common side is split the same way.
  const std::array<Double3, 4> b = {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}};
  std::array<Double3, 4> t = {{{0, 0, 1}, {1.2, 0.1, 1.4}, {1, 1.3, 0.8}, {-0.3, 1, 1.1}}};
  const auto both = [&] {
    return prism_volume({{b[0], b[1], b[2]}}, {{t[0], t[1], t[2]}}) +
           prism_volume({{b[0], b[2], b[3]}}, {{t[0], t[2], t[3]}});
  };
  const double before = both();
  const Double3 away = {5, -4, 3};
  std::array<Double3, 4> bb = b, tt = t;
  for (Double3& p : bb) p = p + away;
  for (Double3& p : tt) p = p + away;
  CHECK(prism_volume({{bb[0], bb[1], bb[2]}}, {{tt[0], tt[1], tt[2]}}) +
            prism_volume({{bb[0], bb[2], bb[3]}}, {{tt[0], tt[2], tt[3]}}) ==
        Approx(before));
}

TEST_CASE("displacement volumes: at rest nothing moves, and a bend keeps the volume", "[unit]") {
  const bool square = GENERATE(false, true);
  CAPTURE(square);
  const Tube t = tube(4.0, 0.5 * kPi, square);
  DisplacementVolumeReport still, bent;
  const std::vector<Double3> same =
      displacement_volumes({t.base, t.surface}, {t.base, t.surface}, t.faces, t.free, {}, still);
  double moved = 0.0;
  for (std::size_t v = 0; v < same.size(); ++v) moved = std::max(moved, norm(same[v] - t.surface[v]));
  CHECK(moved < 1e-12);
  CHECK(still.off_after < 1e-12);
  const std::vector<Double3> kept =
      displacement_volumes({t.base, t.surface}, {t.posed_base, t.posed_surface}, t.faces, t.free, {}, bent);
  CHECK(bent.prisms == t.faces.size());
  CHECK(bent.off_before > 0.1);  // the outside grows, the inside shrinks
  CHECK(bent.off_after < 0.01);
  CHECK(bent.volume_after == Approx(1.0).epsilon(0.01));
  CHECK(folded(t, kept) == 0);
  for (std::size_t v = 0; v < kept.size(); ++v)
    if (!t.free[v]) CHECK(kept[v] == t.posed_surface[v]);
}
