// Where samples end, the surface ends in a smooth curve, and every block cuts it in the same place.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <vector>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"
#include "kernels/mesh/face_contact.h"
#include "octree/vector.h"
#include "tests/helpers/analytic_field.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/oriented_samples.h"
#include "tests/helpers/random.h"
#include "tests/helpers/traced_brick.h"

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

/// One cell whose loop of seven twists: its nodes, and normals of its roots as noise makes them.
DirectedField twisted_cell() {
  struct Root {
    Int3 node;
    int axis;
    EdgeRoot root;
  };
  const std::vector<Root> roots = {{{0, 1, 1}, 0, {0.7557f, {0.730f, 0.472f, 0.493f}}},
                                   {{0, 0, 1}, 1, {0.5932f, {0.415f, -0.134f, 0.900f}}},
                                   {{0, 0, 0}, 2, {0.3056f, {0.693f, 0.115f, 0.712f}}},
                                   {{1, 0, 0}, 2, {0.9844f, {0.618f, 0.321f, 0.718f}}},
                                   {{1, 0, 0}, 1, {0.8240f, {0.427f, 0.746f, -0.511f}}},
                                   {{0, 0, 0}, 1, {0.2049f, {0.643f, 0.046f, 0.765f}}},
                                   {{0, 1, 0}, 2, {0.5195f, {0.326f, 0.351f, -0.878f}}}};
  const Int3 at = {96, 96, 96};
  const auto in_cell = [&](const Int3& n) { return Int3{n[0] - at[0], n[1] - at[1], n[2] - at[2]}; };
  DirectedField field = test::build_field(
      {64, 64, 64}, {64, 64, 64},
      [&](const Int3& n) {
        const Int3 c = in_cell(n);
        return c == Int3{0, 0, 0} || c == Int3{1, 0, 0} || c == Int3{0, 1, 1} ? -1.0 : 0.2;
      },
      [&](const Int3& n, double) {
        const Int3 c = in_cell(n);
        return std::all_of(c.begin(), c.end(), [](int x) { return x == 0 || x == 1; });
      },
      [&](const Int3& n, int axis) {
        return std::find_if(roots.begin(), roots.end(),
                            [&](const Root& r) { return r.node == in_cell(n) && r.axis == axis; })
            ->root;
      });
  const auto move = [&](const Root& r, const Float3& by) {
    const EdgeRoot* root = field.root_at(32 + r.node[0], 32 + r.node[1], 32 + r.node[2], r.axis);
    field.moves.push_back({static_cast<std::uint32_t>(root - field.roots.data()), by});
    BandLeaf& leaf = field.leaves.front();
    leaf.moving[static_cast<std::size_t>(r.axis)][static_cast<std::size_t>(r.node[2])] |=
        std::uint64_t{1} << DirectedField::bit(r.node[0], r.node[1]);
    leaf.any_moving = true;
  };
  move(roots[4], {-0.093f, -0.104f, -0.230f});
  move(roots[6], {-0.205f, -0.071f, -0.105f});
  return field;
}

}  // namespace

TEST_CASE("border: faces of a cell do not cross each other where its loop twists", "[unit]") {
  const DirectedField field = twisted_cell();
  REQUIRE(field.leaves.size() == 1);
  REQUIRE(field.roots.size() == 7);
  test::TracedBrick brick(field);
  brick.trace();
  const Patch patch = brick.patch.finish();
  REQUIRE(patch.faces.size() == 5);
  std::vector<ContactFace> faces;
  for (const PatchFace& f : patch.faces) {
    ContactFace& face = faces.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) face.corner[k] = wide(patch.position[f[k]]), face.vertex[k] = f[k];
  }
  for (std::size_t i = 0; i < faces.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      CAPTURE(i, j);
      CHECK(face_contact(faces[i], faces[j]) == FaceContact::kNone);
    }
}

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
