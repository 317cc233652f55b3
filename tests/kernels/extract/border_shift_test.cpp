// Where samples end, the surface ends in a smooth curve, and every block cuts it in the same place.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"
#include "octree/vector.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/oriented_samples.h"
#include "tests/helpers/random.h"

namespace border_shift_test {

using namespace tessera;

namespace {

constexpr double kSlope = 0.3;
const Double3 kCentre = {128.2, 127.7, 128.4};

double from_centre(const Double3& p) {
  return std::hypot(p[0] - kCentre[0], p[1] - kCentre[1]);
}

/// A tilted plane between two circles around the common corner of eight bricks.
test::Samples ring(double inner, double outer, double spacing, double noise) {
  test::Random random(21);
  test::Samples samples;
  const double size = std::sqrt(1.0 + kSlope * kSlope);
  for (double y = kCentre[1] - outer; y < kCentre[1] + outer; y += spacing)
    for (double x = kCentre[0] - outer; x < kCentre[0] + outer; x += spacing) {
      Double3 p = {x + spacing * random.unit(), y + spacing * random.unit(), 0.0};
      p[2] = kCentre[2] + kSlope * (p[0] - kCentre[0]);
      if (from_centre(p) < inner || from_centre(p) > outer) continue;
      samples.push_back({p, {-kSlope / size, 0.0, 1.0 / size}, 0});
    }
  test::add_noise(noise, random, samples);
  return samples;
}

std::vector<Patch> patches_of(const test::Samples& samples, const Int3& origin, const Int3& cells,
                              double noise) {
  FieldOptions options;
  options.noise_cells = noise;
  std::vector<Patch> patches;
  extract_surface(
      evaluate_field(test::make_block(samples, origin, cells, field_halo_cells(options)), options), {},
      [&](Patch&& p) { patches.push_back(std::move(p)); });
  return patches;
}

/// Length of the border outside or inside of a circle, and how far its vertices lie from another.
struct Border {
  double length = 0.0, nearest = 1e30, farthest = 0.0;
};
Border border_of(const test::IndexedMesh& mesh, double minimum, double maximum) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> count;
  for (const auto& f : mesh.faces)
    for (std::size_t e = 0; e < 3; ++e) ++count[std::minmax(f[e], f[(e + 1) % 3])];
  Border out;
  for (const auto& [edge, faces] : count) {
    const Double3 &a = mesh.position[edge.first], &b = mesh.position[edge.second];
    if (faces != 1 || from_centre(a) < minimum || from_centre(a) > maximum) continue;
    out.length += norm(b - a);
    out.nearest = std::min(out.nearest, from_centre(a));
    out.farthest = std::max(out.farthest, from_centre(a));
  }
  return out;
}

}  // namespace

TEST_CASE("border: it is a smooth curve where the samples end, outside and around a hole", "[property]") {
  const double spacing = GENERATE(0.4, 0.67);
  const double noise = GENERATE(0.0, 0.1);
  CAPTURE(spacing, noise);
  const double inner = 8.0, outer = 30.0;
  const test::IndexedMesh mesh =
      test::weld(patches_of(ring(inner, outer, spacing, noise), {64, 64, 64}, {128, 128, 128}, noise));
  REQUIRE(mesh.faces.size() > 4000);
  // The circles are ellipses on the plane: at most 4.5 % longer.
  for (const double radius : {inner, outer}) {
    CAPTURE(radius);
    const Border border = border_of(mesh, radius == inner ? 0.0 : 20.0, radius == inner ? 20.0 : 64.0);
    CHECK(border.nearest > radius - 1.0);
    CHECK(border.farthest < radius + 1.0);
    CHECK(border.length < 1.1 * 2 * 3.14159265358979 * radius);
  }
  for (const auto& f : mesh.faces) {
    const Double3& p = mesh.position[f[0]];
    const Double3 n = cross(mesh.position[f[1]] - p, mesh.position[f[2]] - p);
    REQUIRE(n[2] > (noise > 0 ? 0.0 : 1e-6));
  }
}

TEST_CASE("border: the same cut from every block", "[property]") {
  const double noise = GENERATE(0.0, 0.4);
  const test::Samples samples = ring(5.0, 25.0, 0.67, noise);
  std::map<Int3, std::pair<std::vector<Float3>, std::vector<PatchFace>>> whole;
  for (Patch& p : patches_of(samples, {64, 64, 64}, {128, 128, 128}, noise))
    whole[p.brick] = {std::move(p.position), std::move(p.faces)};
  REQUIRE(whole.size() >= 4);
  std::size_t seen = 0;
  for (int b = 0; b < 8; ++b) {
    const Int3 origin = {64 + 64 * (b & 1), 64 + 64 * (b >> 1 & 1), 64 + 64 * (b >> 2)};
    for (const Patch& p : patches_of(samples, origin, {64, 64, 64}, noise)) {
      ++seen;
      CHECK(whole[p.brick].first == p.position);
      CHECK(whole[p.brick].second == p.faces);
    }
  }
  CHECK(seen == whole.size());
}

}  // namespace border_shift_test
