#include "kernels/smooth/border_fairing.h"

#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "octree/portable_math.h"
#include "tests/helpers/random.h"

namespace border_fairing_test {

using namespace tessera;

namespace {

const Double3 kSlope = {0.3, 0.0, -1.0};  ///< normal of the plane, not of unit length

/// A strip of a tilted plane, `columns` x 4 vertices of this spacing, whose lower border wavers by up to `waver` and
/// whose vertices lie up to `noise` off the plane.
BorderStrip ragged_strip(int columns, double spacing, double waver, double noise) {
  test::Random random(7);
  BorderStrip strip;
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < 4; ++j) {
      Double3 p = {spacing * i, spacing * j, 0.0};
      if (j == 0) p[1] -= waver * random.unit();
      p[2] = kSlope[0] * p[0] + noise * (2.0 * random.unit() - 1.0);
      strip.position.push_back(p);
      strip.at_border.push_back(j == 0);
    }
  const auto at = [](int i, int j) { return static_cast<std::uint32_t>(4 * i + j); };
  for (int i = 0; i + 1 < columns; ++i)
    for (int j = 0; j < 3; ++j) {
      strip.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      strip.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return strip;
}

double border_length(const BorderStrip& strip) {
  double length = 0.0;
  for (std::size_t v = 4; v < strip.position.size(); v += 4)
    length += norm(strip.position[v] - strip.position[v - 4]);
  return length;
}

double off_plane(const Double3& p) {
  return dot(p, kSlope) / norm(kSlope);
}

}  // namespace

TEST_CASE("border fairing: a ragged border becomes a smooth line, nothing else moves", "[unit]") {
  const BorderStrip before = ragged_strip(60, 0.75, 0.6, 0.0);
  BorderStrip after = before;
  fair_border(after, 0.0);
  const double straight = 59 * 0.75 * std::sqrt(1.0 + kSlope[0] * kSlope[0]);
  CHECK(border_length(before) > 1.03 * straight);
  CHECK(border_length(after) < 1.005 * straight);
  for (std::size_t v = 0; v < after.position.size(); ++v) {
    CAPTURE(v);
    if (v % 4 != 0) CHECK(after.position[v] == before.position[v]);
    CHECK(norm(after.position[v] - before.position[v]) <= 1.0);
    CHECK(std::abs(off_plane(after.position[v])) < 1e-12);
  }
  // The two ends have one border edge each.
  CHECK(after.position.front() == before.position.front());
  CHECK(after.position[4 * 59] == before.position[4 * 59]);
  for (const auto& f : after.faces)
    CHECK(triangle_normal(after.position[f[0]], after.position[f[1]], after.position[f[2]])[2] > 0.0);
}

TEST_CASE("border fairing: off the surface no farther than the noise", "[unit]") {
  const BorderStrip before = ragged_strip(60, 0.75, 0.3, 0.2);
  const double lift = GENERATE(0.0, 0.05, 0.2);
  BorderStrip after = before;
  fair_border(after, lift);
  double rough_before = 0.0, rough_after = 0.0, maximum = 0.0;
  for (std::size_t v = 8; v + 8 < after.position.size(); v += 4) {
    rough_before += std::abs(off_plane(before.position[v]));
    rough_after += std::abs(off_plane(after.position[v]));
    maximum = std::max(maximum, std::abs(off_plane(after.position[v]) - off_plane(before.position[v])));
  }
  // Normals at the vertices differ from that of the plane: way along the surface takes them some of it off the plane.
  CHECK(maximum < lift + 0.25);
  if (lift > 0.1) CHECK(rough_after < 0.7 * rough_before);
}

TEST_CASE("border fairing: vertices go no farther than a cell of their own", "[unit]") {
  const BorderStrip before = ragged_strip(60, 0.75, 0.6, 0.0);
  // In another unit the same happens.
  BorderStrip cells = before, metres = before;
  fair_border(cells, 0.1);
  for (Double3& p : metres.position) p = p * 0.25;
  metres.cell.assign(metres.position.size(), 0.25);
  fair_border(metres, 0.025);
  for (std::size_t v = 0; v < cells.position.size(); ++v)
    CHECK(metres.position[v] == Double3(cells.position[v] * 0.25));
  // Where cells are small vertices stay nearer.
  BorderStrip mixed = before;
  mixed.cell.assign(mixed.position.size(), 1.0);
  const double small = 0.05;
  for (std::size_t v = 0; v < mixed.cell.size() / 2; ++v) mixed.cell[v] = small;
  fair_border(mixed, 0.1);
  std::size_t farther = 0;
  for (std::size_t v = 0; v < mixed.cell.size(); ++v) {
    const double by = norm(mixed.position[v] - before.position[v]);
    CHECK(by <= mixed.cell[v]);
    farther += by > small;
  }
  CHECK(farther > 5);
}

TEST_CASE("border fairing: what is far away along the border decides nothing", "[property]") {
  const BorderStrip whole = ragged_strip(200, 0.75, 0.6, 0.1);
  BorderStrip faired = whole;
  fair_border(faired, 0.1);
  BorderStrip cut;
  std::map<std::uint32_t, std::uint32_t> slot;
  const double minimum = 50.0, maximum = 60.0;
  for (const auto& f : whole.faces) {
    const auto near = [&](std::uint32_t v) {
      return whole.position[v][0] >= minimum - kBorderHalo && whole.position[v][0] <= maximum + kBorderHalo;
    };
    if (!near(f[0]) && !near(f[1]) && !near(f[2])) continue;
    auto& face = cut.faces.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [at, fresh] = slot.try_emplace(f[i], static_cast<std::uint32_t>(slot.size()));
      if (fresh) {
        cut.position.push_back(whole.position[f[i]]);
        cut.at_border.push_back(whole.at_border[f[i]]);
      }
      face[i] = at->second;
    }
  }
  REQUIRE(cut.position.size() < whole.position.size() / 2);
  fair_border(cut, 0.1);
  std::size_t compared = 0;
  for (const auto& [v, s] : slot) {
    if (whole.position[v][0] < minimum || whole.position[v][0] > maximum) continue;
    CHECK(cut.position[s] == faired.position[v]);
    ++compared;
  }
  CHECK(compared > 40);
}

TEST_CASE("border fairing: a vertex where two sheets touch stays", "[unit]") {
  BorderStrip strip;
  strip.position = {{0, 0, 0}, {1, -0.5, 0}, {1, 0.5, 0}, {-1, 0.4, 0}, {-1, -0.6, 0}};
  strip.faces = {{0, 1, 2}, {0, 3, 4}};
  strip.at_border = {1, 1, 1, 1, 1};
  const Double3 tip = strip.position[0];
  fair_border(strip, 0.1);
  CHECK(strip.position[0] == tip);
  CHECK(strip.position[1] != Double3{1, -0.5, 0});
}

TEST_CASE("border fairing: a small hole does not shrink to a point, a large one becomes round", "[unit]") {
  const std::uint32_t corners = GENERATE(3u, 8u, 12u, 30u);
  const bool shadow = GENERATE(false, true);
  CAPTURE(corners, shadow);
  BorderStrip strip;
  const double radius = 0.15 * corners;
  for (std::uint32_t i = 0; i < corners; ++i)
    for (const double r : {i % 2 ? 0.8 * radius : radius, radius + 1.0}) {
      const SinCos angle = sin_cos(2.0 * kPi * i / corners);
      strip.position.push_back({r * angle.cos, r * angle.sin, 0.0});
      strip.at_border.push_back(r <= radius);
    }
  for (std::uint32_t i = 0; i < corners; ++i) {
    const std::uint32_t a = 2 * i, b = 2 * ((i + 1) % corners);
    strip.faces.push_back({a, a + 1, b + 1});
    strip.faces.push_back({a, b + 1, b});
  }
  const BorderStrip before = strip;
  fair_border(strip, 0.1, shadow ? kShadowFairing : BorderFairing());
  std::uint32_t moved = 0;
  for (std::uint32_t i = 0; i < corners; ++i) moved += strip.position[2 * i] != before.position[2 * i];
  CHECK(moved == (corners > (shadow ? 12u : 8u) ? corners : 0));
}

TEST_CASE(
    "border fairing: rims of shadows that waver over many edges become straight, no farther than they may",
    "[unit]") {
  // Waves of ten edges, a cell and a half from crest to trough.
  BorderStrip before = ragged_strip(60, 0.75, 0.0, 0.0);
  for (std::uint32_t i = 0; i < 60; ++i)
    before.position[4 * i][1] -= 0.75 + 0.75 * sin_cos(0.2 * kPi * i).sin;
  BorderStrip plain = before, shadow = before;
  fair_border(plain, 0.0);
  fair_border(shadow, 0.0, kShadowFairing);
  const double straight = 59 * 0.75 * std::sqrt(1.0 + kSlope[0] * kSlope[0]);
  CHECK(border_length(before) > 1.07 * straight);
  CHECK(border_length(shadow) < 1.01 * straight);
  CHECK(border_length(shadow) - straight < 0.5 * (border_length(plain) - straight));
  for (std::size_t v = 0; v < shadow.position.size(); ++v)
    CHECK(norm(shadow.position[v] - before.position[v]) <= kShadowFairing.max_shift);
}

}  // namespace border_fairing_test
