// Prisms keep their volumes in a pose, and what vectors fold over does not fold (thesis, figure 5.8).
#include "kernels/edit/displacement_volumes.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/edit/base_volume.h"
#include "kernels/edit/edit_regions.h"
#include "kernels/edit/self_intersections.h"

namespace displacement_volumes_test {

namespace {

using namespace tessera;

constexpr double kPi = 3.14159265358979323846;
constexpr double kLength = 10.0;

/// A closed bar along x, round of radius 1 or square of side 2.
struct Bar {
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

Bar bar(int around, bool square) {
  Bar b;
  const int along = static_cast<int>(around * kLength / (square ? 8.0 : 2.0 * kPi));
  for (int i = 0; i <= along; ++i)
    for (int j = 0; j < around; ++j) {
      const double x = kLength * i / along;
      const double t = 2.0 * kPi * (j + 0.5 * (i % 2)) / around;
      Double3 p = {x, std::cos(t), std::sin(t)};
      if (square) {
        const int side = 4 * j / around;
        const double u = 2.0 * (4.0 * j / around - side) - 1.0;
        const Double3 at[4] = {{x, u, -1}, {x, 1, u}, {x, -u, 1}, {x, -1, -u}};
        p = at[side];
      }
      b.position.push_back(p);
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * around + j % around); };
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < around; ++j) {
      const bool rising = square ? (i + j) % 2 == 0 : i % 2 == 0;
      if (rising) {
        b.faces.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
        b.faces.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
      } else {
        b.faces.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
        b.faces.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
      }
    }
  for (const int end : {0, along}) {
    const auto centre = static_cast<std::uint32_t>(b.position.size());
    b.position.push_back({kLength * end / along, 0, 0});
    for (int j = 0; j < around; ++j)
      b.faces.push_back(end == 0 ? std::array<std::uint32_t, 3>{centre, at(0, j + 1), at(0, j)}
                                 : std::array<std::uint32_t, 3>{centre, at(end, j), at(end, j + 1)});
  }
  return b;
}

/// The bar between x = from and kLength - from bent by `degrees`.
struct Bend {
  Bar bar;
  EditBasis basis;
  std::vector<std::uint8_t> free;
  std::vector<Double3> rest, posed, vectors;
  std::vector<Rotation> rotations;
  std::vector<LayerLevel> levels;

  Bend(Bar b, double from, double degrees) : bar(std::move(b)) {
    const double to = kLength - from;
    std::vector<EditRegion> regions(2);
    regions[0].role = RegionRole::kSupport;
    regions[0].shape = RegionShape::kBox;
    regions[0].low = {from, -9, -9};
    regions[0].high = {to, 9, 9};
    regions[1].role = RegionRole::kHandle;
    regions[1].name = "end";
    regions[1].shape = RegionShape::kHalfSpace;
    regions[1].point = {to, 0, 0};
    regions[1].normal = {-1, 0, 0};
    EditBasisReport report;
    basis = edit_basis({bar.position, bar.faces}, laplacian({bar.position, bar.faces}),
                       resolve_regions(regions, {bar.position, bar.faces}, 2), {.order = 2}, report);
    free = support_flags(basis.role);
    const std::vector<Placement> pose = {rotation({0, 0, 1}, degrees).about({0.5 * kLength, 0, 0})};
    rest = rest_base(basis, bar.position);
    posed = smooth_base(basis, bar.position, pose);
    const std::vector<Rotation> posed_rotation = pose_rotations(basis, pose);
    vectors = posed_base(basis, bar.position, posed_rotation, rest, posed);
    rotations.assign(bar.position.size(), Rotation{});
    for (std::size_t k = 0; k < posed_rotation.size(); ++k)
      rotations[static_cast<std::size_t>(basis.active[k])] = posed_rotation[k];
    levels = layer_levels(bar.position, bar.faces, free);
  }

  std::vector<Double3> kept(bool whole, DisplacementVolumeReport& report) const {
    std::vector<Double3> widening;
    if (whole) widening = volume_widening(basis, rest, posed, bar.faces);
    return displacement_volumes(
        {{rest, bar.position}, {posed, vectors}, bar.faces, free, rotations, widening}, levels, {}, report);
  }
  double change(std::span<const Double3> p) const {
    return enclosed_volume(p, bar.faces) / enclosed_volume(bar.position, bar.faces) - 1.0;
  }
  std::size_t crossing(std::span<const Double3> p) const {
    return self_intersections(p, bar.faces, {}).faces.size();
  }
};

/// Degrees by which the faces at the four long edges of a square bar turn against each other, at the least.
double sharpest_left(const Bend& b, std::span<const Double3> p) {
  struct Edge {
    std::uint32_t low, high;
    std::size_t face;
    bool operator<(const Edge& o) const {
      return low != o.low ? low < o.low : high != o.high ? high < o.high : face < o.face;
    }
  };
  std::vector<Edge> edges;
  for (std::size_t f = 0; f < b.bar.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = b.bar.faces[f][k], w = b.bar.faces[f][(k + 1) % 3];
      edges.push_back({std::min(v, w), std::max(v, w), f});
    }
  std::sort(edges.begin(), edges.end());
  const auto rotation = [&](std::span<const Double3> at, std::size_t i) {
    const auto normal = [&](std::size_t f) {
      const auto& c = b.bar.faces[f];
      return unit_or_zero(triangle_normal(at[c[0]], at[c[1]], at[c[2]]));
    };
    return std::acos(std::clamp(dot(normal(edges[i].face), normal(edges[i + 1].face)), -1.0, 1.0)) * 180.0 /
           kPi;
  };
  double minimum = 180.0;
  std::size_t seen = 0;
  for (std::size_t i = 0; i + 1 < edges.size(); i += 2) {
    if (!b.free[edges[i].low] && !b.free[edges[i].high]) continue;
    if (rotation(b.bar.position, i) < 80.0) continue;
    minimum = std::min(minimum, rotation(p, i));
    ++seen;
  }
  REQUIRE(seen > 100);
  return minimum;
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
  const auto both = [&](std::span<const Double3> l, std::span<const Double3> h) {
    return prism_volume({{l[0], l[1], l[2]}}, {{h[0], h[1], h[2]}}) +
           prism_volume({{l[0], l[2], l[3]}}, {{h[0], h[2], h[3]}});
  };
  std::array<Double3, 4> bb = b, tt = t;
  const Double3 away = {5, -4, 3};
  for (Double3& p : bb) p = p + away;
  for (Double3& p : tt) p = p + away;
  CHECK(both(bb, tt) == Approx(both(b, t)));
  // A closed body over its base: the prisms fill what is between them.
  const Bar outer = bar(16, false);
  std::vector<Double3> inner;
  for (const Double3& p : outer.position) inner.push_back({0.5 * p[0] + 1.0, 0.3 * p[1], 0.2 * p[2]});
  double sum = 0.0;
  for (const auto& f : outer.faces)
    sum += prism_volume({{inner[f[0]], inner[f[1]], inner[f[2]]}},
                        {{outer.position[f[0]], outer.position[f[1]], outer.position[f[2]]}});
  CHECK(sum == Approx(enclosed_volume(outer.position, outer.faces) - enclosed_volume(inner, outer.faces)));
}

TEST_CASE("displacement volumes: at rest nothing moves", "[unit]") {
  const Bend b(bar(24, GENERATE(false, true)), 2.0, 0.0);
  DisplacementVolumeReport report;
  const std::vector<Double3> same = b.kept(false, report);
  double moved = 0.0;
  for (std::size_t v = 0; v < same.size(); ++v) moved = std::max(moved, norm(same[v] - b.bar.position[v]));
  CHECK(moved < 1e-12);
  CHECK(report.off_after < 1e-11);
}

// Figure 5.8, cylinder and cuboid; short supports, so that vectors intersect, and several resolutions.
TEST_CASE("displacement volumes: a right angle keeps volumes and sharp edges, and nothing intersects",
          "[unit]") {
  const bool square = GENERATE(false, true);
  const double from = GENERATE(2.0, 3.0);
  const int around = GENERATE(48, 80);
  CAPTURE(square, from, around);
  const Bend b(bar(around, square), from, 90.0);
  REQUIRE(b.crossing(b.bar.position) == 0);
  REQUIRE(b.crossing(b.posed) == 0);
  CHECK(std::fabs(b.change(b.vectors)) > 0.1);
  if (from == 3.0) CHECK(b.crossing(b.vectors) > 20);
  DisplacementVolumeReport prisms, whole;
  const std::vector<Double3> layer = b.kept(false, prisms), kept = b.kept(true, whole);
  if (from == 2.0) CHECK(b.crossing(layer) == 0);
  CHECK(b.crossing(kept) == 0);
  CHECK(std::fabs(b.change(kept)) < 0.01);
  CHECK(prisms.prisms > 1000);
  CHECK(prisms.off_before > 0.1);
  CHECK(prisms.off_after < 0.05);
  CHECK(whole.off_after < 0.02);
  CHECK(whole.volume_after == Approx(1.0).epsilon(0.02));
  if (square && from == 2.0) CHECK(sharpest_left(b, kept) > 50.0);
  for (std::size_t v = 0; v < kept.size(); ++v)
    if (!b.free[v]) CHECK(norm(kept[v] - b.vectors[v]) < 1e-12);
}

TEST_CASE("base volume: a bend narrows the base, and the widening makes up for it", "[unit]") {
  const Bend b(bar(48, false), 2.0, 90.0);
  const double was = enclosed_volume(b.rest, b.bar.faces);
  CHECK(enclosed_volume(b.posed, b.bar.faces) < 0.95 * was);
  std::vector<Double3> wide = volume_widening(b.basis, b.rest, b.posed, b.bar.faces);
  for (std::size_t v = 0; v < wide.size(); ++v) {
    if (!b.free[v]) CHECK(wide[v] == Double3{0, 0, 0});
    wide[v] = wide[v] + b.posed[v];
  }
  CHECK(enclosed_volume(wide, b.bar.faces) == Approx(was).epsilon(1e-6));
}

}  // namespace displacement_volumes_test
