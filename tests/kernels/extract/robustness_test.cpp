// What real scans do to the open surface: stripes, thin plates, density that varies, noise; and where it must end.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"
#include "octree/vector.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/oriented_samples.h"
#include "tests/helpers/solids.h"

namespace robustness_test {

using namespace tessera;

namespace {

constexpr int kCells = 64;
constexpr double kSlope = 0.2;
const Int3 kOrigin = {64, 64, 64};
const Double3 kCentre = {96.13, 95.71, 96.37};

DirectedField field_of(const test::Samples& samples, const FieldOptions& options = {}) {
  return evaluate_field(
      test::make_block(samples, kOrigin, {kCells, kCells, kCells}, field_halo_cells(options)), options);
}

test::IndexedMesh mesh_of(const test::Samples& samples, const FieldOptions& options = {}) {
  std::vector<Patch> patches;
  extract_surface(field_of(samples, options), {}, [&](Patch&& p) { patches.push_back(std::move(p)); });
  return test::weld(patches);
}

/// A sample of the plane that rises by kSlope along x, at height `z` where x = 96.
test::Sample on_plane(double x, double y, double z) {
  const double size = std::sqrt(1.0 + kSlope * kSlope);
  return {{x, y, z + kSlope * (x - 96.0)}, {-kSlope / size, 0.0, 1.0 / size}, 0};
}

/// Columns of the block that do not cross the plane exactly once, at the right height and with its normal, and
/// crossings that lie beside an incomplete cell: all zero where the surface is one sheet without hole.
struct Columns {
  std::size_t none = 0, many = 0, off = 0, tilted = 0;
};
Columns columns_of(const DirectedField& field, double z, double tolerance, double cosine) {
  Columns c;
  const auto valid = [&](int i, int j, int k) {
    const BandLeaf* leaf = field.leaf_at(i, j, k);
    return leaf && leaf->is_valid(BandLeaf::node(i, j, k));
  };
  for (int j = 1; j < kCells; ++j)
    for (int i = 1; i < kCells; ++i) {
      int crossings = 0;
      for (int k = 1; k < kCells - 1; ++k) {
        const EdgeRoot* root = field.root_at(i, j, k, 2);
        if (!root) continue;
        bool whole = true;
        for (int b = 0; b < 27; ++b) whole &= valid(i + b % 3 - 1, j + b / 3 % 3 - 1, k + b / 18);
        crossings += whole;
        const double at = 64.0 + k + static_cast<double>(root->t);
        c.off += std::abs(at - z - kSlope * (64.0 + i - 96.0)) > tolerance;
        const auto n = on_plane(0, 0, 0).n;
        double dot = 0;
        for (std::size_t a = 0; a < 3; ++a) dot += n[a] * static_cast<double>(root->normal[a]);
        c.tilted += dot < cosine;
      }
      c.none += crossings == 0;
      c.many += crossings > 1;
    }
  return c;
}

void check_plane(const Columns& c) {
  CHECK(c.none == 0);
  CHECK(c.many == 0);
  CHECK(c.off == 0);
  CHECK(c.tilted == 0);
}

/// Distance of every vertex to its nearest sample, cells.
class Nearest {
 public:
  explicit Nearest(const test::Samples& samples) : samples_(samples) {
    for (std::size_t i = 0; i < samples.size(); ++i) cells_[cell(samples[i].p)].push_back(i);
  }
  /// At most 8.
  double distance(const Double3& p) const {
    const Int3 c = cell(p);
    double best = 64.0;
    for (int z = -2; z <= 2; ++z)
      for (int y = -2; y <= 2; ++y)
        for (int x = -2; x <= 2; ++x) {
          const auto found = cells_.find({c[0] + x, c[1] + y, c[2] + z});
          if (found == cells_.end()) continue;
          for (const std::size_t i : found->second) {
            double d2 = 0;
            for (std::size_t a = 0; a < 3; ++a) d2 += (samples_[i].p[a] - p[a]) * (samples_[i].p[a] - p[a]);
            best = std::min(best, d2);
          }
        }
    return std::sqrt(best);
  }

 private:
  static Int3 cell(const Double3& p) {
    return {static_cast<int>(std::floor(p[0] / 4)), static_cast<int>(std::floor(p[1] / 4)),
            static_cast<int>(std::floor(p[2] / 4))};
  }
  const test::Samples& samples_;
  std::map<Int3, std::vector<std::size_t>> cells_;
};

}  // namespace

TEST_CASE("robustness: stripes up to 1.1 radii apart give one sheet without holes", "[property]") {
  const double apart = GENERATE(0.5, 1.5, 2.4, 3.3), angle = GENERATE(0.0, 0.35, 0.7854),
               noise = GENERATE(0.0, 0.1);
  CAPTURE(apart, angle, noise);
  test::Random random(11);
  test::Samples samples;
  const double c = std::cos(angle), s = std::sin(angle);
  for (int line = -90; line <= 90; ++line) {
    const double phase = random.unit();
    for (int k = -900; k <= 900; ++k) {
      const double along = (k + phase) * 0.1, across = line * apart;
      const double x = 96.0 + along * c - across * s, y = 96.0 + along * s + across * c;
      if (x < 50 || x > 142 || y < 50 || y > 142) continue;
      samples.push_back(on_plane(x, y, 96.3));
    }
  }
  test::add_noise(noise, random, samples);
  FieldOptions options;
  options.noise_cells = noise;
  check_plane(
      columns_of(field_of(samples, options), 96.3, noise > 0 ? 0.15 : 0.01, noise > 0 ? 0.99 : 0.9999));
}

TEST_CASE("robustness: density that varies by a factor of 400 gives one sheet without holes", "[property]") {
  // Spacing of 0.08 to 1.6 cells: from a slope, or from a dense patch in a sparse scan.
  const bool sudden = GENERATE(false, true);
  const double noise = GENERATE(0.0, 0.1);
  CAPTURE(sudden, noise);
  test::Random random(12);
  test::Samples samples;
  for (double x = 50; x < 142;) {
    const double share = (x - 50) / 92;
    const double spacing = sudden ? (std::abs(x - 90) < 8 ? 0.08 : 1.6) : 0.08 + 1.52 * share * share;
    for (double y = 50; y < 142; y += spacing)
      samples.push_back(on_plane(x + 0.5 * spacing * random.unit(), y + 0.5 * spacing * random.unit(), 96.3));
    x += spacing;
  }
  test::add_noise(noise, random, samples);
  FieldOptions options;
  options.noise_cells = noise;
  check_plane(
      columns_of(field_of(samples, options), 96.3, noise > 0 ? 0.3 : 0.01, noise > 0 ? 0.97 : 0.9999));
}

TEST_CASE("robustness: samples a radius apart carry the surface, beside dense ones and alone", "[property]") {
  const bool alone = GENERATE(false, true);
  test::Random random(14);
  test::Samples samples;
  for (double y = 44; y < 148; y += 2.8)
    for (double x = 44; x < 148; x += 2.8)
      samples.push_back(on_plane(x + 0.3 * random.unit(), y + 0.3 * random.unit(), 96.3));
  for (int i = 0; i < 4000 && !alone; ++i)
    samples.push_back(on_plane(random.in(80, 104), random.in(44, 148), 96.3));
  check_plane(columns_of(field_of(samples), 96.3, 0.01, 0.9999));
}

TEST_CASE("robustness: the radius does not grow across a border or a hole of dense samples", "[property]") {
  test::Random random(15);
  test::Samples samples;
  test::add_face(
      {50, 50, 96.3}, {40, 0, 0}, {0, 92, 0}, {0, 0, 1}, 1 / 1.5,
      [](const Double3& p) { return std::hypot(p[0] - 75, p[1] - 96) > 4.0; }, random, samples);
  const test::IndexedMesh mesh = mesh_of(samples);
  REQUIRE(mesh.faces.size() > 2000);
  std::size_t in_hole = 0;
  double farthest = 0;
  for (const Double3& p : mesh.position) {
    farthest = std::max(farthest, p[0]);
    in_hole += std::hypot(p[0] - 75, p[1] - 96) < 2.0;
  }
  CHECK(farthest <= 91.0);
  CHECK(in_hole == 0);
}

TEST_CASE("robustness: the two sides of a thin plate stay two sheets, each with its own side", "[property]") {
  const double radii = GENERATE(0.5, 1.0, 1.5, 2.0, 3.0), noise = GENERATE(0.0, 0.1);
  const bool gap = GENERATE(false, true), tilted = GENERATE(false, true);
  CAPTURE(radii, noise, gap, tilted);
  const FieldOptions exact;
  const test::Solid solid = test::make_slab(kCentre, radii * exact.radius_cells, gap, tilted);
  test::Random random(13);
  test::Samples samples = solid.sample(kCentre, 45, 1 / 1.5, random);
  test::add_noise(noise, random, samples);
  FieldOptions options;
  options.noise_cells = noise;
  const test::IndexedMesh mesh = mesh_of(samples, options);
  const test::MeshChecks checks = test::check_mesh(mesh);
  CHECK(checks.components == 2);
  CHECK(checks.non_manifold_edges == 0);
  CHECK(checks.non_manifold_vertices == 0);
  CHECK(checks.misoriented_edges == 0);
  CHECK(checks.duplicate_faces == 0);
  CHECK(checks.degenerate_faces == 0);
  CHECK(checks.boundary_loops == 2);
  REQUIRE(mesh.faces.size() > 10000);
  std::size_t reversed_faces = 0, off = 0;
  for (const auto& f : mesh.faces) {
    const Double3 &a = mesh.position[f[0]], &b = mesh.position[f[1]], &d = mesh.position[f[2]];
    Double3 u, v, middle;
    for (std::size_t i = 0; i < 3; ++i)
      u[i] = b[i] - a[i], v[i] = d[i] - a[i], middle[i] = (a[i] + b[i] + d[i]) / 3;
    Double3 n = cross(u, v);
    const double length = norm(n);
    for (double& x : n) x /= length;
    off += std::abs(solid.value(middle)) > (noise > 0 ? 0.3 : 0.02);
    if (length < 0.02) continue;  // a sliver: its normal is what rounding makes of it
    reversed_faces += solid.normal_error(middle, n, 0.5) > 1.0;
  }
  CHECK(off == 0);
  CHECK(reversed_faces == 0);
}

TEST_CASE("robustness: an open surface has no face farther than the support radius from the data",
          "[property]") {
  const double radius = GENERATE(2.0, 3.0, 4.0);
  const int shape = GENERATE(range(0, 8));
  CAPTURE(radius, shape);
  test::Random random(static_cast<std::uint64_t>(20 + shape));
  test::Samples samples;
  const auto anywhere = [&] { return Double3{random.in(70, 122), random.in(70, 122), random.in(70, 122)}; };
  const auto direction = [&] {
    Double3 n = {random.gaussian(), random.gaussian(), random.gaussian()};
    const double length = norm(n) + 1e-9;
    for (double& c : n) c /= length;
    return n;
  };
  FieldOptions options;
  options.radius_cells = radius;
  switch (shape) {
    case 0:  // a sphere with a third of its samples, in balls, missing
      test::add_sphere(kCentre, 24.3, 1 / 1.5, random, samples);
      for (int ball = 0; ball < 12; ++ball) {
        const Double3 n = direction();
        std::erase_if(samples, [&](const test::Sample& s) { return dot(s.n, n) > 0.9; });
      }
      break;
    case 1:  // ragged: single samples missing, four of five
      test::add_sphere(kCentre, 24.3, 1 / 1.5, random, samples);
      std::erase_if(samples, [&](const test::Sample&) { return random.unit() < 0.8; });
      break;
    case 2:  // a torn box: creases that run into the border
      test::add_box({75, 76, 77}, {118, 117, 116}, 1 / 1.5, random, samples);
      std::erase_if(samples, [](const test::Sample& s) {
        return std::sin(0.31 * s.p[0]) * std::sin(0.27 * s.p[1]) * std::sin(0.29 * s.p[2]) > 0.15;
      });
      break;
    case 3:  // noise of half a cell, far samples too
      test::add_torus(kCentre, 18, 8, 1 / 1.5, random, samples);
      test::add_noise(0.5, random, samples);
      for (int i = 0; i < 400; ++i) samples.push_back({anywhere(), direction(), 0});
      options.noise_cells = 0.5;
      break;
    case 4:  // dust
      for (int i = 0; i < 20000; ++i) samples.push_back({anywhere(), direction(), 0});
      break;
    case 5:  // dust whose normals agree
      for (int i = 0; i < 6000; ++i) samples.push_back({anywhere(), {0.6, 0.0, 0.8}, 0});
      break;
    case 6:  // single scan lines, far apart
      for (int line = 0; line < 12; ++line)
        for (int k = 0; k < 600; ++k) samples.push_back(on_plane(66 + 0.1 * k, 68 + 5.0 * line, 96.3));
      break;
    default:  // a strip that ends in a point, normals a quarter turn off at random
      for (int i = 0; i < 4000; ++i) {
        const double x = random.in(70, 122);
        test::Sample s = on_plane(x, 96 + (x - 70) * random.in(-0.2, 0.2), 96.3);
        if (random.unit() < 0.2) s.n = direction();
        samples.push_back(s);
      }
  }
  // As the job stores them: to the quantum.
  for (test::Sample& s : samples)
    for (double& c : s.p) c = std::floor(c * kQuantaPerCell + 0.5) / kQuantaPerCell;
  const test::IndexedMesh mesh = mesh_of(samples, options);
  const Nearest nearest(samples);
  double farthest = 0;
  std::size_t sure = 0;
  for (const auto& f : mesh.faces) {
    Double3 middle{};
    for (const std::uint32_t v : f)
      for (std::size_t a = 0; a < 3; ++a) middle[a] += mesh.position[v][a] / 3;
    farthest = std::max(farthest, nearest.distance(middle));
    ++sure;
  }
  for (const Double3& p : mesh.position) farthest = std::max(farthest, nearest.distance(p));
  if (shape != 5 && !(shape == 6 && radius < 3)) REQUIRE(sure > 500);
  CHECK(farthest <= radius);
}

}  // namespace robustness_test
