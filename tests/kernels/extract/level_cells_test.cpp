// Bricks of several sizes: pure noise in all of them must give one manifold, with a border only where cells take no part.
#include "kernels/extract/level_cells.h"

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <set>

#include "kernels/extract/cell_loops.h"
#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/mesh/patch_mesh.h"
#include "octree/level_tree.h"
#include "tests/helpers/mesh_checks.h"
#include "tests/helpers/random.h"

namespace level_cells_test {

using namespace tessera;

namespace {

std::uint64_t mixed(std::uint64_t x) {
  x ^= x >> 31;
  x *= 0x7fb5d329728ea185ULL;
  x ^= x >> 27;
  x *= 0x81dadef4bc2dd44dULL;
  return x ^ x >> 33;
}

/// A field of every level that is random at every node, or that of a shape: the same wherever one asks for it.
struct World {
  std::uint64_t seed = 1;
  Int3 middle = {0, 0, 0};  ///< finest nodes; the field is there within `extent` of it
  int extent = 0;
  unsigned holes = 0;   ///< one node in so many has no value; 0 = none
  unsigned moving = 0;  ///< one root in so many lies beyond the border; 0 = none
  double radius = 0.0;  ///< of a sphere about the middle, finest cells; 0 = noise
  double reach = 0.0;   ///< how far from the sphere nodes have a value, cells of their level; 0 = anywhere

  std::uint64_t hash(int level, const Int3& n, int what) const {
    std::uint64_t h = mixed(seed + static_cast<std::uint64_t>(what));
    h = mixed(h ^ static_cast<std::uint64_t>(level));
    for (const int c : n) h = mixed(h ^ static_cast<std::uint64_t>(static_cast<std::uint32_t>(c)));
    return h;
  }
  double unit(int level, const Int3& n, int what) const {
    return static_cast<double>(hash(level, n, what) >> 11) * 0x1p-53;
  }
  Double3 away(int level, const Int3& n, std::size_t axis, double t) const {
    Double3 d;
    for (std::size_t a = 0; a < 3; ++a)
      d[a] = (n[a] + (a == axis ? t : 0.0)) * (1 << level) - middle[a] - 0.37;
    return d;
  }
  bool valid(int level, const Int3& n) const {
    for (std::size_t a = 0; a < 3; ++a)
      if (std::abs(n[a] * (1 << level) - middle[a]) > extent) return false;
    if (reach > 0.0 && std::abs(double{value(level, n)}) > reach) return false;
    return holes == 0 || hash(level, n, 1) % holes != 0;
  }
  float value(int level, const Int3& n) const {
    if (radius == 0.0) return static_cast<float>(2.0 * unit(level, n, 2) - 1.0);
    const Double3 d = away(level, n, 0, 0.0);
    return static_cast<float>((std::sqrt(dot(d, d)) - radius) / (1 << level));
  }
  EdgeRoot root(int level, const Int3& n, std::size_t axis, float a, float b) const {
    const int what = 10 * static_cast<int>(axis);
    EdgeRoot r;
    if (radius == 0.0) {
      r.t = static_cast<float>(0.05 + 0.9 * unit(level, n, what + 3));
      Float3 d;
      for (int c = 0; c < 3; ++c)
        d[static_cast<std::size_t>(c)] = static_cast<float>(2.0 * unit(level, n, what + 4 + c) - 1.0);
      const float length = norm(d);
      for (std::size_t c = 0; c < 3; ++c) r.normal[c] = d[c] / length;
      return r;
    }
    double low = 0.0, high = 1.0;
    for (int i = 0; i < 40; ++i) {
      const double t = 0.5 * (low + high);
      const Double3 d = away(level, n, axis, t);
      ((dot(d, d) < radius * radius) == (a < 0.0f) ? low : high) = t;
    }
    r.t = std::clamp(static_cast<float>(low), 1.0f / 64, 63.0f / 64);
    const Double3 d = away(level, n, axis, low);
    for (std::size_t c = 0; c < 3; ++c) r.normal[c] = static_cast<float>(d[c] / std::sqrt(dot(d, d)));
    (void)b;
    return r;
  }

  /// \param block  of nodes of the level
  DirectedField field(int level, const Int3& origin, int cells) const {
    DirectedField f;
    f.origin = origin;
    f.cells = {cells, cells, cells};
    const int d = cells / 8 + 2;
    f.leaf_index.assign(static_cast<std::size_t>(d * d * d), -1);
    std::size_t slot = 0;
    for (int k = -1; k < d - 1; ++k)
      for (int j = -1; j < d - 1; ++j)
        for (int i = -1; i < d - 1; ++i, ++slot) {
          if (!within({origin[0] + 8 * i, origin[1] + 8 * j, origin[2] + 8 * k}, level)) continue;
          BandLeaf leaf(origin, {8 * i, 8 * j, 8 * k});
          LeafWords words{};
          bool any = false;
          for (std::size_t n = 0; n < 512; ++n) {
            const Int3 at = global(f, leaf, n);
            if (!valid(level, at)) continue;
            any = true;
            const std::uint64_t bit = std::uint64_t{1} << (n & 63);
            words[n >> 6] |= bit;
            leaf.value(n) = value(level, at);
            if (leaf.value(n) < 0.0f) leaf.inside[n >> 6] |= bit;
          }
          if (!any) continue;
          leaf.set_valid(words);
          f.leaf_index[slot] = static_cast<std::int32_t>(f.leaves.size());
          f.leaves.push_back(std::move(leaf));
        }
    for (BandLeaf& leaf : f.leaves) add_roots(level, f, leaf);
    for (BandLeaf& leaf : f.leaves) end(f, leaf);
    return f;
  }

 private:
  bool within(const Int3& leaf, int level) const {
    for (std::size_t a = 0; a < 3; ++a)
      if ((leaf[a] + 8) * (1 << level) < middle[a] - extent || leaf[a] * (1 << level) > middle[a] + extent)
        return false;
    return true;
  }
  static Int3 global(const DirectedField& f, const BandLeaf& leaf, std::size_t n) {
    return {f.origin[0] + leaf.origin[0] + static_cast<int>(n & 7),
            f.origin[1] + leaf.origin[1] + static_cast<int>(n >> 3 & 7),
            f.origin[2] + leaf.origin[2] + static_cast<int>(n >> 6)};
  }
  void add_roots(int level, DirectedField& f, BandLeaf& leaf) const {
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::size_t z = 0; z < 8; ++z) {
        leaf.first_root[axis][z] = static_cast<std::uint32_t>(f.roots.size());
        for (std::size_t b = 0; b < 64; ++b) {
          const std::size_t n = 64 * z + b;
          if (!leaf.is_valid(n)) continue;
          Int3 end = leaf.origin;
          end[0] += static_cast<int>(b & 7), end[1] += static_cast<int>(b >> 3),
              end[2] += static_cast<int>(z);
          const Int3 at = global(f, leaf, n);
          ++end[axis];
          if (end[axis] > f.cells[axis] + 1) continue;
          const BandLeaf* other = f.leaf_at(end[0], end[1], end[2]);
          const std::size_t e = BandLeaf::node(end[0], end[1], end[2]);
          if (!other || !other->is_valid(e)) continue;
          const float from = leaf.value(n), to = other->value(e);
          if ((from < 0.0f) == (to < 0.0f)) continue;
          const std::uint64_t bit = std::uint64_t{1} << b;
          leaf.crossing[axis][z] |= bit;
          if (moving != 0 && hash(level, at, 40 + static_cast<int>(axis)) % moving == 0) {
            leaf.moving[axis][z] |= bit;
            leaf.any_moving = true;
            f.moves.push_back({static_cast<std::uint32_t>(f.roots.size()), {0.1f, 0.1f, 0.1f}});
          }
          f.roots.push_back(root(level, at, axis, from, to));
        }
      }
  }
  /// As find_border() ends the surface: cells all of whose vertices lie beyond the border.
  void end(const DirectedField& f, BandLeaf& leaf) const {
    if (moving == 0) return;
    for (std::size_t n = 0; n < 512; ++n) {
      bool deep = false;
      for (int e = 0; e < kCellEdges; ++e) {
        const Int3 at = {leaf.origin[0] + static_cast<int>(n & 7) + edge_offset(e, 0),
                         leaf.origin[1] + static_cast<int>(n >> 3 & 7) + edge_offset(e, 1),
                         leaf.origin[2] + static_cast<int>(n >> 6) + edge_offset(e, 2)};
        if (at[0] > f.cells[0] + 1 || at[1] > f.cells[1] + 1 || at[2] > f.cells[2] + 1) continue;
        const BandLeaf* l = f.leaf_at(at[0], at[1], at[2]);
        if (!l) continue;
        const auto z = static_cast<std::size_t>(at[2] & 7);
        const auto axis = static_cast<std::size_t>(e >> 2);
        deep |= ((l->crossing[axis][z] & ~l->moving[axis][z]) >> DirectedField::bit(at[0], at[1]) & 1) != 0;
      }
      if (!deep) leaf.ended[n >> 6] |= std::uint64_t{1} << (n & 63);
    }
  }
};

/// Only what the extraction may look at.
void keep_wanted(DirectedField& f, const LevelSurroundings& around,
                 bool (*wanted)(const LevelSurroundings&, const Int3&)) {
  for (BandLeaf& leaf : f.leaves) {
    LeafWords valid = leaf.valid();
    for (std::size_t n = 0; n < 512; ++n) {
      const Int3 at = {leaf.origin[0] + static_cast<int>(n & 7) - kLevelMargin,
                       leaf.origin[1] + static_cast<int>(n >> 3 & 7) - kLevelMargin,
                       leaf.origin[2] + static_cast<int>(n >> 6) - kLevelMargin};
      if (!wanted(around, at)) valid[n >> 6] &= ~(std::uint64_t{1} << (n & 63));
    }
    leaf.set_valid(valid);
  }
}

Patch patch_of(const World& world, const LevelTree& tree, const Int3& leaf, int level,
               const ExtractOptions& options, ExtractReport& report) {
  LevelSurroundings around;
  around.step = tree.steps_around(leaf, level);
  const Int3 corner = {leaf[0] * kBrickCells, leaf[1] * kBrickCells, leaf[2] * kBrickCells};
  const auto before = [](const Int3& c, int twice, int half) {
    return Int3{c[0] * twice / half - kLevelMargin, c[1] * twice / half - kLevelMargin,
                c[2] * twice / half - kLevelMargin};
  };
  LevelFields fields;
  fields.own = world.field(level, before(corner, 1, 1), kOwnLevelCells);
  keep_wanted(fields.own, around, wanted_own);
  if (around.has(-1)) {
    fields.finer = world.field(level - 1, before(corner, 2, 1), kFinerLevelCells);
    keep_wanted(fields.finer, around, wanted_finer);
  }
  if (around.has(1)) {
    fields.coarser = world.field(level + 1, before(corner, 1, 2), kCoarserLevelCells);
    keep_wanted(fields.coarser, around, wanted_coarser);
  }
  return extract_level_brick(fields, around, level, options, report);
}

struct Result {
  std::size_t faces = 0, bricks = 0, levels = 0;
  std::size_t unlike = 0;        ///< vertices of one name at two places, or of two classes
  std::size_t wrong_border = 0;  ///< edges of one face that are not marked as border, or the other way round
  test::MeshChecks checks;
};

Result mesh_of(const World& world, const LevelTree& tree, const ExtractOptions& options,
               ExtractReport& report) {
  Int3 low, high;
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = (world.middle[a] - world.extent - 12) >> kBrickBits;
    high[a] = (world.middle[a] + world.extent + 12) >> kBrickBits;
  }
  std::set<std::pair<int, Int3>> leaves;
  for (int z = low[2]; z <= high[2]; ++z)
    for (int y = low[1]; y <= high[1]; ++y)
      for (int x = low[0]; x <= high[0]; ++x) {
        const int level = tree.level_of({x, y, z});
        leaves.insert({level, {x >> level, y >> level, z >> level}});
      }
  MeshFrame frame;
  frame.lattice.h = 1.0;
  frame.double_positions = true;
  std::map<std::uint64_t, std::uint32_t> number;
  std::map<std::pair<std::uint32_t, std::uint32_t>, bool> edges;  // directed, with its border mark
  test::IndexedMesh mesh;
  Result result;
  std::set<int> levels;
  for (const auto& [level, leaf] : leaves) {
    const Patch patch = patch_of(world, tree, leaf, level, options, report);
    if (patch.faces.empty()) continue;
    ++result.bricks;
    levels.insert(level);
    const MeshBlock block = make_mesh_block(patch, frame);
    std::vector<std::uint8_t> used(block.key.size(), 0);
    for (const auto& f : block.faces)
      for (const std::uint32_t v : f) used[v] = 1;
    std::vector<std::uint32_t> index(block.key.size());
    for (std::size_t v = 0; v < block.key.size(); ++v) {
      if (!used[v]) continue;
      const auto [found, is_new] = number.emplace(block.key[v], static_cast<std::uint32_t>(number.size()));
      index[v] = found->second;
      if (is_new) {
        mesh.position.push_back(block.position[v]);
        mesh.vertex_class.push_back(block.vertex_class[v]);
      } else if (mesh.position[index[v]] != block.position[v] ||
                 mesh.vertex_class[index[v]] != block.vertex_class[v]) {
        ++result.unlike;
      }
    }
    for (std::size_t f = 0; f < block.faces.size(); ++f) {
      std::array<std::uint32_t, 3> face;
      for (std::size_t c = 0; c < 3; ++c) face[c] = index[block.faces[f][c]];
      mesh.faces.push_back(face);
      for (std::size_t c = 0; c < 3; ++c)
        edges[{face[c], face[(c + 1) % 3]}] = (block.face_flags[f] >> c & 1) != 0;
    }
  }
  for (const auto& [edge, border] : edges)
    result.wrong_border += border == (edges.count({edge.second, edge.first}) != 0);
  result.faces = mesh.faces.size();
  result.levels = levels.size();
  result.checks = test::check_mesh(mesh);
  return result;
}

/// A tree of three levels with a place where bricks meet.
struct Site {
  LevelTree tree;
  Int3 middle;
};
bool mixes_levels(const Site& site) {
  std::set<int> levels;
  for (int c = 0; c < 8; ++c)
    levels.insert(site.tree.level_of({(site.middle[0] >> kBrickBits) - (c & 1),
                                      (site.middle[1] >> kBrickBits) - (c >> 1 & 1),
                                      (site.middle[2] >> kBrickBits) - (c >> 2)}));
  return levels.size() > 1;
}
Site random_site(test::Random& random) {
  const auto at = [&](std::uint64_t n) { return static_cast<int>(random.below(n)); };
  for (;;) {
    std::vector<std::vector<std::uint64_t>> split(3);
    for (int i = 0; i < 2; ++i) split[1].push_back(brick_key({2 + at(4), 2 + at(4), 2 + at(4)}));
    for (int i = 0; i < 2; ++i) split[2].push_back(brick_key({1 + at(2), 1 + at(2), 1 + at(2)}));
    Site site{LevelTree(3, split), {}};
    for (std::size_t a = 0; a < 3; ++a) site.middle[a] = (5 + at(6)) * kBrickCells;
    if (mixes_levels(site)) return site;
  }
}

ExtractOptions named(ExtractMethod method) {
  ExtractOptions options;
  options.method = method;
  options.names = true;
  return options;
}

}  // namespace

TEST_CASE("levels: pure noise on random levels is a manifold that ends where cells take no part",
          "[property]") {
  const unsigned holes = GENERATE(0u, 40u), moving = GENERATE(0u, 3u);
  const ExtractMethod method = GENERATE(ExtractMethod::kMarchingCubes, ExtractMethod::kExtendedMarchingCubes);
  test::Random random(17 + holes + moving);
  std::size_t mixed_sites = 0, faces = 0;
  ExtractReport report;
  for (int trial = 0; trial < 8; ++trial) {
    const Site site = random_site(random);
    World world;
    world.seed = random.bits();
    world.middle = site.middle;
    world.extent = 22;
    world.holes = holes;
    world.moving = moving;
    const Result r = mesh_of(world, site.tree, named(method), report);
    CAPTURE(trial, holes, moving, r.bricks, r.levels);
    mixed_sites += r.levels > 1;
    faces += r.faces;
    CHECK(r.unlike == 0);
    CHECK(r.wrong_border == 0);
    CHECK(r.checks.non_manifold_edges == 0);
    CHECK(r.checks.non_manifold_vertices == 0);
    CHECK(r.checks.misoriented_edges == 0);
    CHECK(r.checks.duplicate_faces == 0);
  }
  CHECK(mixed_sites == 8);
  CHECK(faces > 100'000);
}

TEST_CASE("levels: a sphere across three levels is closed, and as round as its cells are small",
          "[property]") {
  test::Random random(3);
  ExtractReport report;
  std::size_t mixed_sites = 0;
  // Samples tell as many cells of each level: of a coarse cell beside finer ones, twice as wide, they miss some nodes.
  const double reach = GENERATE(0.0, 2.0);
  for (int trial = 0; trial < 6; ++trial) {
    const Site site = random_site(random);
    World world;
    world.middle = site.middle;
    world.extent = 60;
    world.radius = 41.0;
    world.reach = reach;
    const Result r = mesh_of(world, site.tree, named(ExtractMethod::kExtendedMarchingCubes), report);
    CAPTURE(trial, reach, r.bricks, r.levels);
    mixed_sites += r.levels > 1;
    CHECK(r.unlike == 0);
    CHECK(r.wrong_border == 0);
    CHECK(r.checks.defects() == r.checks.degenerate_faces);
    CHECK(r.checks.boundary_edges == 0);
    CHECK(r.checks.components == 1);
    CHECK(r.checks.euler == 2);
  }
  CHECK(mixed_sites == 6);
}

TEST_CASE("levels: what two levels share belongs to the finer one", "[unit]") {
  LevelSurroundings around;
  around.step[1 + 3 + 9 + 1] = -1;  // beyond the max face across x
  const int edge = 128;
  CHECK(around.touching({128, 5, 5}, {0, 0, 0}, edge).minimum == -1);
  CHECK(around.touching({127, 5, 5}, {0, 0, 0}, edge).minimum == 0);
  CHECK(around.touching({126, 5, 5}, {2, 0, 0}, edge).minimum == 0);  // ends there, lies here
  CHECK(around.touching({128, 4, 4}, {0, 2, 2}, edge).minimum == -1);
  CHECK(around.touching({128, 0, 0}, {0, 0, 0}, edge).maximum == 0);
  CHECK_FALSE(around.uniform());
  LevelFields none;
  const LevelPair pair(none.own, none.finer, around, edge, -1);
  CHECK(pair.is_transition({126, 0, 0}));
  CHECK_FALSE(pair.is_transition({124, 0, 0}));
}

}  // namespace level_cells_test
