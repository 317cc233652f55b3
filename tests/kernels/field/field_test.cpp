#include "kernels/field/field.h"

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <map>

#include "kernels/extract/extended_marching_cubes.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/oriented_samples.h"
#include "tests/helpers/solids.h"

namespace field_test {

using namespace tessera;

namespace {

constexpr int kCells = 64;
const Int3 kOrigin = {64, 64, 64};
const Int3 kSize = {kCells, kCells, kCells};

DirectedField field_of(const test::Samples& samples, const FieldOptions& options = {}, Int3 origin = kOrigin,
                       Int3 cells = kSize) {
  return evaluate_field(test::make_block(samples, origin, cells, field_halo_cells(options)), options);
}

/// Points without normal, evenly within a ball.
void add_volumetric(const Double3& centre, double radius, int count, test::Random& random,
                    test::Samples& out) {
  while (count > 0) {
    Double3 d;
    for (double& c : d) c = random.in(-radius, radius);
    if (norm(d) > radius) continue;
    out.push_back({centre + d, {0, 0, 0}, 0xff208040u});
    --count;
  }
}

struct Root {
  Int3 node;  ///< global
  int axis;
  Double3 p;  ///< global, cells
  EdgeRoot edge;
};

std::vector<Root> roots_of(const DirectedField& field) {
  std::vector<Root> out;
  for (const BandLeaf& leaf : field.leaves)
    for (int axis = 0; axis < 3; ++axis)
      for (int z = 0; z < 8; ++z)
        for (int b = 0; b < 64; ++b) {
          const Int3 at = {leaf.origin[0] + (b & 7), leaf.origin[1] + (b >> 3), leaf.origin[2] + z};
          const EdgeRoot* root = field.root_at(at[0], at[1], at[2], axis);
          if (!root) continue;
          Root r{
              {at[0] + field.origin[0], at[1] + field.origin[1], at[2] + field.origin[2]}, axis, {}, *root};
          for (std::size_t c = 0; c < 3; ++c) r.p[c] = r.node[c];
          r.p[static_cast<std::size_t>(axis)] += static_cast<double>(root->t);
          out.push_back(r);
        }
  return out;
}

bool valid_at(const DirectedField& field, int i, int j, int k) {
  const BandLeaf* leaf = field.leaf_at(i, j, k);
  return leaf && leaf->is_valid(BandLeaf::node(i, j, k));
}
bool inside_at(const DirectedField& field, int i, int j, int k) {
  const BandLeaf* leaf = field.leaf_at(i, j, k);
  return leaf && (leaf->inside[static_cast<std::size_t>(k & 7)] >> DirectedField::bit(i, j) & 1);
}

/// Everything that a block says about the nodes and edges of a box, by global node.
std::map<Int3, std::vector<std::uint32_t>> bits_of(const DirectedField& field, const Int3& low,
                                                   const Int3& high) {
  std::map<Int3, std::vector<std::uint32_t>> out;
  for (int k = low[2]; k < high[2]; ++k)
    for (int j = low[1]; j < high[1]; ++j)
      for (int i = low[0]; i < high[0]; ++i) {
        const int a = i - field.origin[0], b = j - field.origin[1], c = k - field.origin[2];
        if (!valid_at(field, a, b, c)) continue;
        auto& words = out[{i, j, k}];
        const float value = field.leaf_at(a, b, c)->value(BandLeaf::node(a, b, c));
        words.push_back(std::bit_cast<std::uint32_t>(value));
        words.push_back(inside_at(field, a, b, c));
        for (int axis = 0; axis < 3; ++axis) {
          const EdgeRoot* root = field.root_at(a, b, c, axis);
          words.push_back(root != nullptr);
          if (!root) continue;
          words.push_back(std::bit_cast<std::uint32_t>(root->t));
          for (const float n : root->normal) words.push_back(std::bit_cast<std::uint32_t>(n));
          words.push_back(std::bit_cast<std::uint32_t>(root->offset));
          words.push_back(root->rgba);
        }
      }
  return out;
}

}  // namespace

TEST_CASE("field: a tilted plane is exact", "[unit]") {
  test::Random random(1);
  test::Samples samples;
  // z = 96.3 + 0.2 (x - 96) - 0.1 (y - 96)
  const Double3 normal = {-0.2 / std::sqrt(1.05), 0.1 / std::sqrt(1.05), 1.0 / std::sqrt(1.05)};
  for (int i = 0; i < 120; ++i)
    for (int j = 0; j < 120; ++j) {
      const double x = 56 + (i + random.unit()) / 1.5, y = 56 + (j + random.unit()) / 1.5;
      samples.push_back({{x, y, 96.3 + 0.2 * (x - 96) - 0.1 * (y - 96)}, normal, 0});
    }
  const DirectedField field = field_of(samples);
  const auto roots = roots_of(field);
  REQUIRE(roots.size() > 4000);
  for (const Root& r : roots) {
    const double d = (r.p[2] - 96.3 - 0.2 * (r.p[0] - 96) + 0.1 * (r.p[1] - 96)) / std::sqrt(1.05);
    const auto along = static_cast<double>(r.edge.normal[static_cast<std::size_t>(r.axis)]);
    // `offset` undoes what keeping roots off the nodes does. Quantisation alone gives 5e-4.
    REQUIRE(std::abs(d + static_cast<double>(r.edge.offset)) < 2e-3);
    REQUIRE((r.edge.offset == 0.0f || r.edge.t == 1 / 64.0f || r.edge.t == 63 / 64.0f));
    REQUIRE(std::abs(along) > 0.0);
    double dot = 0;
    for (std::size_t c = 0; c < 3; ++c) dot += static_cast<double>(r.edge.normal[c]) * normal[c];
    REQUIRE(dot > 0.99999);
  }
  SECTION("values are signed distances, negative inside, on both sides of the surface") {
    int seen = 0;
    for (const BandLeaf& leaf : field.leaves)
      for (int n = 0; n < 512; ++n) {
        if (!leaf.is_valid(static_cast<std::size_t>(n))) continue;
        const double x = leaf.origin[0] + (n & 7) + 64.0, y = leaf.origin[1] + (n >> 3 & 7) + 64.0,
                     z = leaf.origin[2] + (n >> 6) + 64.0;
        const double d = (z - 96.3 - 0.2 * (x - 96) + 0.1 * (y - 96)) / std::sqrt(1.05);
        REQUIRE(std::abs(static_cast<double>(leaf.value(static_cast<std::size_t>(n))) - d) < 5e-3);
        ++seen;
      }
    CHECK(seen > 12000);
  }
}

TEST_CASE("field: sphere and torus at h = 1.5 spacings", "[unit]") {
  test::Random random(2);
  test::Samples samples;
  SECTION("noise-free sphere: mean error within 0.02 h, closed") {
    test::add_sphere({96, 96, 96}, 25.3, 1 / 1.5, random, samples);
    const auto roots = roots_of(field_of(samples));
    REQUIRE(roots.size() > 10000);
    double sum = 0, worst = 0;
    for (const Root& r : roots) {
      const double d = std::hypot(r.p[0] - 96, r.p[1] - 96, r.p[2] - 96) - 25.3;
      sum += std::abs(d);
      worst = std::max(worst, std::abs(d));
    }
    CHECK(sum / static_cast<double>(roots.size()) < 0.002);
    CHECK(worst < 0.02);
  }
  SECTION("noise of half a spacing: mean error within a quarter") {
    test::add_sphere({96, 96, 96}, 25.3, 1 / 1.5, random, samples);
    test::add_noise(0.5 / 1.5, random, samples);
    FieldOptions options;
    options.noise_cells = 0.5 / 1.5;
    const auto roots = roots_of(field_of(samples, options));
    REQUIRE(roots.size() > 10000);
    double sum = 0;
    for (const Root& r : roots) sum += std::abs(std::hypot(r.p[0] - 96, r.p[1] - 96, r.p[2] - 96) - 25.3);
    CHECK(sum / static_cast<double>(roots.size()) < 0.25 / 1.5);
  }
  SECTION("noise-free torus") {
    test::add_torus({96, 96, 96}, 18, 8, 1 / 1.5, random, samples);
    const auto roots = roots_of(field_of(samples));
    REQUIRE(roots.size() > 5000);
    double sum = 0;
    for (const Root& r : roots)
      sum += std::abs(std::hypot(std::hypot(r.p[0] - 96, r.p[1] - 96) - 18, r.p[2] - 96) - 8);
    CHECK(sum / static_cast<double>(roots.size()) < 0.02);
  }
}

TEST_CASE("field: the same bits from every block that holds a node", "[property]") {
  test::Random random(3);
  test::Samples samples;
  test::add_sphere({140, 131, 128}, 27.7, 1 / 1.5, random, samples);
  test::add_box({90.3, 100.2, 110.7}, {120.1, 125.4, 130.6}, 1 / 1.5, random, samples);
  test::add_noise(0.05, random, samples);
  for (auto& s : samples)  // normals that contradict each other: rough nodes look farther
    for (double& n : s.n) n += (s.p[1] < 120 ? 0.5 : 0.0) * random.gaussian();
  for (auto& s : samples) s.rgba = 0xff000000u | static_cast<std::uint32_t>(random.unit() * 0xffffff);
  add_volumetric({120, 150, 128}, 14, 4000, random, samples);
  FieldOptions options;
  options.radius_cells = GENERATE(3.0, 2.337);
  const bool colour = GENERATE(false, true);
  options.bodies = colour;
  const int halo = field_halo_cells(options);
  const DirectedField whole =
      evaluate_field(test::make_block(samples, {64, 64, 64}, {128, 128, 128}, halo, colour), options);
  std::size_t compared = 0;
  for (const Int3 origin : {Int3{64, 64, 64}, Int3{128, 64, 64}, Int3{64, 128, 64}, Int3{128, 128, 128}}) {
    // A generous halo must not change anything either.
    const DirectedField part = evaluate_field(
        test::make_block(samples, origin, {64, 64, 64}, halo + (origin[0] == 128), colour), options);
    const Int3 low = {std::max(64, origin[0]) - (origin[0] > 64), std::max(64, origin[1]) - (origin[1] > 64),
                      std::max(64, origin[2]) - (origin[2] > 64)};
    const Int3 high = {origin[0] + 64, origin[1] + 64, origin[2] + 64};
    const auto a = bits_of(whole, low, high), b = bits_of(part, low, high);
    CHECK(a == b);
    compared += a.size();
  }
  CHECK(compared > 20000);
}

namespace {

const Double3 kCentre = {96.13, 95.71, 96.37};

/// A crossed edge with a cell around it that is not complete: a border of the surface.
bool is_torn(const DirectedField& field, const Root& r) {
  const auto axis = static_cast<std::size_t>(r.axis);
  for (int c = 0; c < 4; ++c)
    for (int corner = 0; corner < 8; ++corner) {
      Int3 at;
      for (std::size_t a = 0; a < 3; ++a) at[a] = r.node[a] - field.origin[a] + (corner >> a & 1);
      at[(axis + 1) % 3] -= c & 1;
      at[(axis + 2) % 3] -= c >> 1;
      if (*std::min_element(at.begin(), at.end()) < -1 || *std::max_element(at.begin(), at.end()) > kCells)
        continue;
      if (!valid_at(field, at[0], at[1], at[2])) return true;
    }
  return false;
}

struct Quality {
  std::size_t roots = 0, torn = 0, wrong_signs = 0;
  double worst = 0, mean = 0, worst_normal = 0, mean_normal = 0;
};

Quality quality_of(const DirectedField& field, const test::Solid& solid) {
  Quality q;
  for (const Root& r : roots_of(field)) {
    ++q.roots;
    q.torn += is_torn(field, r);
    const double moved = std::abs(static_cast<double>(r.edge.offset));  // kept off the node on purpose
    const double e = std::max(0.0, std::abs(solid.value(r.p)) - moved);
    const Double3 n = {static_cast<double>(r.edge.normal[0]), static_cast<double>(r.edge.normal[1]),
                       static_cast<double>(r.edge.normal[2])};
    const double deviation = solid.normal_error(r.p, n, 0.05 + moved);
    q.worst = std::max(q.worst, e);
    q.mean += e;
    q.worst_normal = std::max(q.worst_normal, deviation);
    q.mean_normal += deviation;
  }
  q.mean /= static_cast<double>(q.roots);
  q.mean_normal /= static_cast<double>(q.roots);
  for (const BandLeaf& leaf : field.leaves)
    for (int n = 0; n < 512; ++n) {
      const Int3 at = {leaf.origin[0] + (n & 7), leaf.origin[1] + (n >> 3 & 7), leaf.origin[2] + (n >> 6)};
      if (!valid_at(field, at[0], at[1], at[2])) continue;
      const double value = solid.value({at[0] + 64.0, at[1] + 64.0, at[2] + 64.0});
      if (std::abs(value) > 0.03 && inside_at(field, at[0], at[1], at[2]) != (value < 0)) ++q.wrong_signs;
    }
  return q;
}

}  // namespace

TEST_CASE("field: creases and corners keep their exact faces", "[unit]") {
  struct Case {
    const char* name;
    test::Solid solid;
    double worst;
  };
  const bool rotated = GENERATE(false, true);
  const Case cases[] = {
      {"cube", test::make_box(kCentre, {21.3, 20.1, 18.7}, rotated), 0.02},
      {"bored block", test::make_bored_block(kCentre, {20.3, 19.1, 17.7}, 12.2, rotated), 0.15},
      {"fandisk", test::make_fandisk(kCentre, 22, rotated), 0.05}};
  for (const Case& c : cases) {
    CAPTURE(c.name, rotated);
    test::Random random(5);
    const auto samples = c.solid.sample(kCentre, 45, 1 / 1.5, random);
    const Quality q = quality_of(field_of(samples), c.solid);
    CHECK(q.roots > 6000);
    CHECK(q.wrong_signs == 0);
    CHECK(q.torn <= 3);
    CHECK(q.mean < 0.001);
    CHECK(q.worst < c.worst);
    CHECK(q.mean_normal < 0.001);
  }
}

TEST_CASE("field: thin plates, slots and steps", "[unit]") {
  const bool rotated = GENERATE(false, true);
  const test::Solid solids[] = {
      test::make_slab(kCentre, 1.2, false, rotated), test::make_slab(kCentre, 1.2, true, rotated),
      test::make_slab(kCentre, 2.4, false, rotated), test::make_slab(kCentre, 2.4, true, rotated),
      test::make_step(kCentre, 1.5, rotated),        test::make_step(kCentre, 2.5, rotated),
      test::make_step(kCentre, 4.0, rotated)};
  for (std::size_t i = 0; i < std::size(solids); ++i) {
    CAPTURE(i, rotated);
    test::Random random(6);
    const Quality q = quality_of(field_of(solids[i].sample(kCentre, 45, 1 / 1.5, random)), solids[i]);
    CHECK(q.roots > 4000);
    CHECK(q.wrong_signs == 0);
    CHECK(q.torn == 0);
    CHECK(q.mean < 0.001);
    CHECK(q.worst < 0.05);
    CHECK(q.worst_normal < 0.02);
  }
}

TEST_CASE("field: depths in planes of the lattice make no wall without thickness", "[unit]") {
  // A depth camera's frame: patches at whole depths, some of them behind others, all seen from above.
  test::Random random(41);
  std::map<std::pair<int, int>, int> depth;
  test::Samples samples;
  for (int i = 0; i < 240; ++i)
    for (int j = 0; j < 240; ++j) {
      const Double3 p = {66.0 + 0.25 * i, 66.0 + 0.25 * j, 0.0};
      const std::pair<int, int> patch = {i / 16, j / 16};
      if (!depth.contains(patch)) depth[patch] = 94 + static_cast<int>(random.below(4));
      samples.push_back({{p[0], p[1], static_cast<double>(depth[patch])}, {0, 0, 1}, 0});
    }
  const DirectedField field = field_of(samples);
  std::map<Int3, std::vector<Double3>> around;  // vertices that stand at a node
  for (const Root& root : roots_of(field)) {
    Int3 node = root.node;
    if (root.edge.t > 0.5f) ++node[static_cast<std::size_t>(root.axis)];
    const Float3 by = root.edge.slide_offset();
    around[node].push_back({root.p[0] + double{by[0]}, root.p[1] + double{by[1]}, root.p[2] + double{by[2]}});
  }
  std::size_t slid = 0;
  for (const Root& root : roots_of(field)) slid += root.edge.slides;
  CHECK(slid > 100);
  double nearest = 1.0;
  for (const auto& [node, vertices] : around)
    for (std::size_t a = 0; a < vertices.size(); ++a)
      for (std::size_t b = 0; b < a; ++b) nearest = std::min(nearest, norm(vertices[a] - vertices[b]));
  CAPTURE(slid);
  CHECK(nearest > 1.0 / 128);
}

TEST_CASE("field: noise does not break a cube", "[unit]") {
  const test::Solid solid = test::make_box(kCentre, {21.3, 20.1, 18.7}, true);
  test::Random random(8);
  auto samples = solid.sample(kCentre, 45, 1 / 1.5, random);
  test::add_noise(0.2 / 1.5, random, samples);
  for (auto& s : samples)
    for (double& n : s.n) n += 0.1 * random.gaussian();
  FieldOptions options;
  options.noise_cells = 0.2 / 1.5;
  const Quality q = quality_of(field_of(samples, options), solid);
  CHECK(q.mean < 0.2 / 1.5 * 0.25);
  CHECK(q.worst < 0.25);
  CHECK(q.torn == 0);
}

TEST_CASE("field: normals that no position confirms make no crease", "[unit]") {
  // Silhouettes of two scans on one smooth surface: in patches all normals of a scan lean to its side.
  const double lean = GENERATE(0.7, 1.2);
  test::Random random(5);
  test::Samples samples;
  test::add_face({70, 70, 96.3}, {52, 0, 0}, {0, 52, 0}, {0, 0, 1}, 0.7, {}, random, samples);
  test::add_noise(0.1, random, samples);
  for (auto& s : samples) {
    const double patch = std::sin(s.p[0] / 2.0) * std::sin(s.p[1] / 2.0);
    if (s.p[0] > 84 && s.p[0] < 108) s.n[0] += patch > 0.3 ? lean : patch < -0.3 ? -lean : 0.0;
    for (double& n : s.n) n += 0.2 * random.gaussian();
  }
  FieldOptions options;
  options.noise_cells = 0.1;
  double worst = 0.0;
  const auto roots = roots_of(field_of(samples, options));
  for (const Root& r : roots) worst = std::max(worst, std::abs(r.p[2] - 96.3));
  CAPTURE(lean);
  CHECK(roots.size() > 2500);
  CHECK(worst < 0.5);
}

TEST_CASE("field: the surface ends at the last samples and closes pinholes", "[unit]") {
  // A plate of samples z = 96.4, x < 96, with a hole of radius 1.5 cells around (80, 96).
  test::Random random(9);
  test::Samples samples;
  test::add_face(
      {56, 56, 96.4}, {40, 0, 0}, {0, 80, 0}, {0, 0, 1}, 1 / 1.5,
      [](const Double3& p) { return std::hypot(p[0] - 80, p[1] - 96) > 1.5; }, random, samples);
  const DirectedField field = field_of(samples);
  double farthest = 0;
  std::size_t in_hole = 0;
  for (const Root& r : roots_of(field)) {
    REQUIRE(r.axis == 2);
    bool complete = true;  // reached by the surface: some cell beside the edge has all its nodes
    if (is_torn(field, r)) complete = false;
    if (complete) farthest = std::max(farthest, r.p[0]);
    if (complete && std::hypot(r.p[0] - 80, r.p[1] - 96) < 1.5) ++in_hole;
  }
  CHECK(farthest >= 94.0);
  CHECK(farthest <= 97.0);
  CHECK(in_hole >= 5);
}

TEST_CASE("field: points without normal are ignored, colour is the mean around the root", "[unit]") {
  test::Random random(10);
  test::Samples samples;
  test::add_face({56, 56, 96.4}, {80, 0, 0}, {0, 80, 0}, {0, 0, 1}, 1 / 1.5, {}, random, samples);
  for (auto& s : samples) s.rgba = s.p[0] < 96 ? 0xff2040ffu : 0xffff8000u;
  const auto clean =
      evaluate_field(test::make_block(samples, kOrigin, kSize, field_halo_cells({}), true), {});
  auto more = samples;
  for (int i = 0; i < 500; ++i)
    more.push_back({{70 + 40 * random.unit(), 70 + 40 * random.unit(), 97.5}, {0, 0, 0}, 0});
  const auto same = evaluate_field(test::make_block(more, kOrigin, kSize, field_halo_cells({}), true), {});
  REQUIRE(clean.roots.size() > 3000);
  CHECK(bits_of(clean, {63, 63, 63}, {129, 129, 129}) == bits_of(same, {63, 63, 63}, {129, 129, 129}));
  for (const Root& r : roots_of(clean)) {
    if (r.p[0] < 94) REQUIRE(r.edge.rgba == 0xff2040ffu);
    if (r.p[0] > 98) REQUIRE(r.edge.rgba == 0xffff8000u);
  }
}

TEST_CASE("field: strewn points get a closed body around them, which joins the ground", "[unit]") {
  test::Random random(12);
  FieldOptions options;
  options.bodies = true;
  const auto mesh_of = [&](const test::Samples& samples) {
    std::vector<Patch> patches;
    const PointBlock block = test::make_block(samples, kOrigin, kSize, field_halo_cells(options), true);
    extract_surface(evaluate_field(block, options), {}, [&](Patch&& p) { patches.push_back(std::move(p)); });
    return test::weld(patches);
  };
  const Double3 centre = {96.2, 95.7, 100.4};
  constexpr double kRadius = 13.0;
  test::Samples crown;
  // From a point in every third cell to three in each.
  add_volumetric(centre, kRadius, GENERATE(3000, 27000), random, crown);
  SECTION("in the air") {
    const test::IndexedMesh mesh = mesh_of(crown);
    const test::MeshChecks checks = test::check_mesh(mesh);
    CHECK(checks.defects() == 0);
    CHECK(checks.boundary_edges == 0);
    CHECK(checks.components == 1);
    CHECK(checks.genus == 0);
    for (const Double3& p : mesh.position) {
      const double distance = norm(p - centre);
      REQUIRE(distance > kRadius - 2);
      REQUIRE(distance < kRadius + 2.5);
    }
    for (const std::uint32_t c : mesh.rgba) REQUIRE(c == 0xff208040u);
  }
  SECTION("on the ground") {
    constexpr double kGround = 94.3;
    std::erase_if(crown, [&](const test::Sample& s) { return s.p[2] < kGround; });
    test::add_face({40, 40, kGround}, {120, 0, 0}, {0, 120, 0}, {0, 0, 1}, 1 / 1.5, {}, random, crown);
    const test::IndexedMesh mesh = mesh_of(crown);
    CHECK(test::check_mesh(mesh).defects() == 0);
    CHECK(test::check_mesh(mesh).boundary_loops == 1);  // where the block ends
    for (const Double3& p : mesh.position)              // nothing of the ground is left within
      REQUIRE(norm(p - centre) > kRadius - 2);
  }
  SECTION("unless they are to be ignored") {
    options.bodies = false;
    CHECK(mesh_of(crown).faces.empty());
  }
}

TEST_CASE("field: two scans that disagree by up to 0.8 radii give one surface", "[property]") {
  const double share = GENERATE(0.3, 0.5, 0.7, 0.8), noise = GENERATE(0.0, 0.1);
  CAPTURE(share, noise);
  const FieldOptions options;
  const double apart = share * options.radius_cells, slope = 0.2;
  test::Random random(3);
  test::Samples samples;
  for (const double height : {96.3, 96.3 + apart * std::sqrt(1 + slope * slope)}) {
    const double size = std::sqrt(1 + slope * slope);
    test::Samples scan;
    test::add_face(
        {40, 40, height - 20 * slope}, {120, 0, 120 * slope}, {0, 120, 0}, {-slope / size, 0, 1 / size},
        1 / 1.5, [](const Double3&) { return true; }, random, scan);
    test::add_noise(noise, random, scan);
    samples.insert(samples.end(), scan.begin(), scan.end());
  }
  const DirectedField field = field_of(samples, options);
  for (int j = 1; j < kCells; ++j)
    for (int i = 1; i < kCells; ++i) {
      int crossings = 0;
      for (int k = 0; k < kCells; ++k) crossings += field.root_at(i, j, k, 2) != nullptr;
      REQUIRE(crossings == 1);
    }
}

TEST_CASE("field: empty, sparse and stacked points give no surface and no trouble", "[unit]") {
  CHECK(field_of({}).leaves.empty());
  CHECK(field_of({{{90, 90, 90}, {0, 0, 1}, 0}}).roots.empty());
  CHECK(field_of(test::Samples(20000, {{90.5, 90.5, 90.5}, {0, 0, 1}, 0})).roots.size() < 100);
}

}  // namespace field_test
