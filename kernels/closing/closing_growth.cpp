#include <algorithm>
#include <cassert>

#include "kernels/closing/closing.h"
#include "octree/morton.h"

namespace tessera {
namespace {

constexpr int kNodes = kBrickCells + 1;
/// Layers of a leaf evaluated at once; with a limit all, for its candidates are found by leaf.
constexpr int kLayers = 2;
constexpr int kLeaves = kBrickCells / kLeafCells + 1;  ///< the last one holds the max faces' nodes

constexpr std::array<Int3, 8> kCorners = {Int3{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                          Int3{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
/// Corners of the faces -x +x -y +y -z +z.
constexpr std::array<unsigned, 6> kFaceCorners = {0x55, 0xaa, 0x33, 0xcc, 0x0f, 0xf0};

bool is_mixed(unsigned inside, unsigned corners) {
  return (inside & corners) != 0 && (~inside & corners) != 0;
}

Int3 neighbour(const Int3& cell, std::size_t face) {
  Int3 n = cell;
  n[face >> 1] += face & 1 ? 1 : -1;
  return n;
}

bool before(const Int3& a, const Int3& b) {
  const auto code = [](const Int3& c) {
    return morton_encode(static_cast<std::uint32_t>(c[0]), static_cast<std::uint32_t>(c[1]),
                         static_cast<std::uint32_t>(c[2]));
  };
  return code(a) < code(b);
}

/// What is known of the nodes of one brick, [0, 64] on each axis.
class BrickNodes {
 public:
  BrickNodes(const Int3& corner, std::span<const BandSigns> signs, std::span<const FixedSigns> fixed,
             const SignSource& field, std::span<const Int3> near_points, const ClosingOptions& options)
      : corner_(corner),
        field_(field),
        near_points_(near_points),
        options_(options),
        node_(std::size_t{kNodes} * kNodes * kNodes, 0),
        evaluated_(std::size_t{kLeaves} * kLeaves * kLeaves * kLeafCells, false),
        layers_(options.limit > 0.0f ? kLeafCells : kLayers) {
    for (const FixedSigns& s : fixed) enter(s.origin, s.known, s.inside, kKnown);
    for (const BandSigns& s : signs) enter(s.origin, s.valid, s.inside, kKnown | kLocal);
    for (const FixedSigns& s : fixed) enter(s.origin, s.forced, s.inside, kKnown);
  }

  /// Signs of the closing field.
  std::vector<BandSigns> evaluated() const {
    std::vector<BandSigns> out;
    for (int index = 0; index < kLeaves * kLeaves * kLeaves; ++index) {
      const Int3 at = {index % kLeaves * kLeafCells, index / kLeaves % kLeaves * kLeafCells,
                       index / (kLeaves * kLeaves) * kLeafCells};
      BandSigns s;
      bool any = false;
      for (int k = 0; k < kLeafCells; ++k) {
        if (!evaluated_[static_cast<std::size_t>(index * kLeafCells + k)]) continue;
        any = true;
        for (int b = 0; b < kLeafCells * kLeafCells; ++b) {
          const Int3 n = {at[0] + (b & 7), at[1] + (b >> 3), at[2] + k};
          if (!holds(n) || (node_[slot(n)] & (kKnown | kLocal)) != kKnown) continue;
          s.valid[static_cast<std::size_t>(k)] |= std::uint64_t{1} << b;
          if (node_[slot(n)] & kInside) s.inside[static_cast<std::size_t>(k)] |= std::uint64_t{1} << b;
        }
      }
      if (!any) continue;
      for (std::size_t a = 0; a < 3; ++a) s.origin[a] = corner_[a] + at[a];
      out.push_back(s);
    }
    return out;
  }

  struct Cell {
    unsigned inside = 0;  ///< bit per corner
    bool local = true;
    bool far = false;
  };
  Cell cell(const Int3& at) {
    Cell c;
    for (std::size_t k = 0; k < 8; ++k) {
      const Int3 n = {at[0] + kCorners[k][0], at[1] + kCorners[k][1], at[2] + kCorners[k][2]};
      if (!(node_[slot(n)] & kKnown))
        evaluate_layers({n[0] >> kLeafBits, n[1] >> kLeafBits, n[2] >> kLeafBits},
                        (n[2] & (kLeafCells - 1)) / layers_ * layers_);
      const std::uint8_t bits = node_[slot(n)];
      c.inside |= bits & kInside ? 1u << k : 0u;
      c.local &= (bits & kLocal) != 0;
      c.far |= (bits & kFar) != 0;
    }
    return c;
  }

 private:
  static constexpr std::uint8_t kKnown = 1, kInside = 2, kLocal = 4, kFar = 8;

  void enter(const Int3& origin, const LeafWords& nodes, const LeafWords& inside, int bits) {
    const Int3 at = {origin[0] - corner_[0], origin[1] - corner_[1], origin[2] - corner_[2]};
    for (int z = 0; z < kLeafCells; ++z)
      for (std::uint64_t left = nodes[static_cast<std::size_t>(z)]; left; left &= left - 1) {
        const int b = std::countr_zero(left);
        const Int3 n = {at[0] + (b & 7), at[1] + (b >> 3), at[2] + z};
        if (!holds(n)) continue;
        const bool in = inside[static_cast<std::size_t>(z)] >> b & 1;
        node_[slot(n)] = static_cast<std::uint8_t>(bits | (in ? kInside : 0));
      }
  }

  static bool holds(const Int3& n) {
    for (const int c : n)
      if (c < 0 || c >= kNodes) return false;
    return true;
  }
  static std::size_t slot(const Int3& n) {
    return static_cast<std::size_t>((n[2] * kNodes + n[1]) * kNodes + n[0]);
  }

  /// Some layers of a leaf at once: their nodes share lists.
  void evaluate_layers(const Int3& leaf, int first) {
    const auto index =
        static_cast<std::size_t>(((leaf[2] * kLeaves + leaf[1]) * kLeaves + leaf[0]) * kLeafCells + first);
    assert(!evaluated_[index]);
    for (std::size_t k = 0; k < static_cast<std::size_t>(layers_); ++k) evaluated_[index + k] = true;
    std::vector<std::size_t> slots;
    std::vector<Int3> queries;
    for (int k = first; k < first + layers_; ++k)
      for (int j = 0; j < kLeafCells; ++j)
        for (int i = 0; i < kLeafCells; ++i) {
          const Int3 n = {leaf[0] * kLeafCells + i, leaf[1] * kLeafCells + j, leaf[2] * kLeafCells + k};
          if (!holds(n) || (node_[slot(n)] & kKnown)) continue;
          node_[slot(n)] = kKnown;
          bool bounded = true;
          for (std::size_t a = 0; a < 3; ++a)
            bounded &= corner_[a] + n[a] > options_.low[a] && corner_[a] + n[a] < options_.high[a];
          if (!bounded) {
            if (options_.level < 0.0f) node_[slot(n)] |= kInside;
            continue;
          }
          slots.push_back(slot(n));
          Int3 q;
          for (std::size_t a = 0; a < 3; ++a) q[a] = (corner_[a] + n[a]) * kQuantaPerCell;
          queries.push_back(q);
        }
    std::vector<float> value(queries.size());
    if (!queries.empty()) field_(queries, value);
    for (std::size_t i = 0; i < queries.size(); ++i)
      if (value[i] < 0.0f) node_[slots[i]] |= kInside;
    if (options_.limit > 0.0f) mark_far(leaf, slots, queries);
  }

  static double squared_distance(const Int3& a, const Int3& b) {
    double d2 = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto d = static_cast<double>(a[c] - b[c]);
      d2 += d * d;
    }
    return d2;
  }

  void mark_far(const Int3& leaf, const std::vector<std::size_t>& slots, const std::vector<Int3>& queries) {
    const double limit = double{options_.limit} * kQuantaPerCell;
    const double radius = limit + 7.0 * kQuantaPerCell;  // more than half the diagonal of a leaf
    Int3 middle;
    for (std::size_t a = 0; a < 3; ++a)
      middle[a] = (corner_[a] + leaf[a] * kLeafCells + kLeafCells / 2) * kQuantaPerCell;
    std::vector<Int3> points;
    for (const Int3& p : near_points_)
      if (squared_distance(p, middle) <= radius * radius) points.push_back(p);
    for (std::size_t i = 0; i < queries.size(); ++i) {
      const bool near = std::any_of(points.begin(), points.end(), [&](const Int3& p) {
        return squared_distance(p, queries[i]) <= limit * limit;
      });
      if (!near) node_[slots[i]] |= kFar;
    }
  }

  Int3 corner_;
  const SignSource& field_;
  std::span<const Int3> near_points_;
  ClosingOptions options_;
  std::vector<std::uint8_t> node_;
  std::vector<bool> evaluated_;  ///< by leaf and layer
  int layers_;                   ///< evaluated together
};

/// One bit per cell of a brick.
class CellBits {
 public:
  static bool holds(const Int3& c) {
    for (const int v : c)
      if (v < 0 || v >= kBrickCells) return false;
    return true;
  }
  /// \returns whether it was not set before
  bool set(const Int3& c) {
    std::uint64_t& word = leaf(c)[static_cast<std::size_t>(c[2] & 7)];
    const std::uint64_t bit = std::uint64_t{1} << ((c[0] & 7) + 8 * (c[1] & 7));
    const bool fresh = !(word & bit);
    word |= bit;
    return fresh;
  }
  bool has(const Int3& c) {
    return leaf(c)[static_cast<std::size_t>(c[2] & 7)] >> ((c[0] & 7) + 8 * (c[1] & 7)) & 1;
  }
  LeafWords& leaf(const Int3& c) {
    return leaves_[morton_encode(static_cast<std::uint32_t>(c[0] >> kLeafBits),
                                 static_cast<std::uint32_t>(c[1] >> kLeafBits),
                                 static_cast<std::uint32_t>(c[2] >> kLeafBits))];
  }
  std::vector<ClosingLeaf> collect(const Int3& corner) const {
    std::vector<ClosingLeaf> out;
    for (std::size_t code = 0; code < leaves_.size(); ++code) {
      std::uint64_t any = 0;
      for (const std::uint64_t w : leaves_[code]) any |= w;
      if (!any) continue;
      const auto at = morton_decode(code);
      ClosingLeaf& leaf = out.emplace_back();
      for (std::size_t a = 0; a < 3; ++a)
        leaf.origin[a] = corner[a] + static_cast<std::int32_t>(at[a]) * kLeafCells;
      leaf.cells = leaves_[code];
    }
    return out;
  }

 private:
  std::vector<LeafWords> leaves_ = std::vector<LeafWords>(512);
};

}  // namespace

std::vector<Int3> boundary_cells(const DirectedField& field) {
  std::vector<Int3> out;
  const auto node = [&](int i, int j, int k, bool& valid, bool& inside) {
    const BandLeaf* leaf = field.leaf_at(i, j, k);
    const auto w = static_cast<std::size_t>(DirectedField::word(k));
    valid = leaf && leaf->is_valid(BandLeaf::node(i, j, k));
    inside = leaf && (leaf->inside[w] >> DirectedField::bit(i, j) & 1);
  };
  /// Whether all nodes are valid; the corners inside.
  const auto look = [&](const Int3& c, unsigned& inside) {
    bool all = true;
    inside = 0;
    for (std::size_t k = 0; k < 8 && all; ++k) {
      bool valid = false, in = false;
      node(c[0] + kCorners[k][0], c[1] + kCorners[k][1], c[2] + kCorners[k][2], valid, in);
      all &= valid;
      inside |= in ? 1u << k : 0u;
    }
    return all;
  };
  const auto global = [&](const Int3& c) {
    return Int3{field.origin[0] + c[0], field.origin[1] + c[1], field.origin[2] + c[2]};
  };
  // Only pairs with a local cell that the surface crosses count, so look at these and both their neighbours.
  for (const BandLeaf& leaf : field.leaves) {
    const LeafWords valid = leaf.valid();
    for (int z = 0; z < kLeafCells; ++z)
      for (std::uint64_t left = valid[static_cast<std::size_t>(z)]; left; left &= left - 1) {
        const int b = std::countr_zero(left);
        const Int3 c = {leaf.origin[0] + (b & 7), leaf.origin[1] + (b >> 3), leaf.origin[2] + z};
        bool in_range = true;
        int below = 0;
        for (std::size_t a = 0; a < 3; ++a) in_range &= c[a] < field.cells[a], below += c[a] < 0;
        if (!in_range || below > 1) continue;
        unsigned inside = 0;
        if (!look(c, inside) || !is_mixed(inside, 0xff)) continue;
        for (std::size_t face = 0; face < 6; ++face) {
          if (!is_mixed(inside, kFaceCorners[face])) continue;
          const Int3 n = neighbour(c, face);
          // The upper cell of the pair lies in the core, the lower one in it or one below.
          const Int3& upper = face & 1 ? n : c;
          bool mine = true;
          for (std::size_t a = 0; a < 3; ++a) mine &= upper[a] >= 0 && upper[a] < field.cells[a];
          unsigned ignored = 0;
          if (mine && !look(n, ignored)) out.push_back(global(n));
        }
      }
  }
  std::sort(out.begin(), out.end(), before);
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

std::vector<BandSigns> signs_of_brick(const DirectedField& field, const Int3& brick) {
  std::vector<BandSigns> out;
  for (const BandLeaf& leaf : field.leaves) {
    bool mine = true;
    for (std::size_t a = 0; a < 3; ++a) mine &= leaf.origin[a] >> kBrickBits == brick[a];
    if (!mine) continue;
    BandSigns& s = out.emplace_back();
    for (std::size_t a = 0; a < 3; ++a) s.origin[a] = field.origin[a] + leaf.origin[a];
    s.valid = leaf.valid();
    s.inside = leaf.inside;
  }
  return out;
}

GrownCells grow_closing(const Int3& corner, std::span<const BandSigns> signs,
                        std::span<const ClosingLeaf> known, std::span<const Int3> seeds,
                        const SignSource& field, std::span<const Int3> near_points,
                        const ClosingOptions& options, std::span<const FixedSigns> fixed) {
  BrickNodes nodes(corner, signs, fixed, field, near_points, options);
  CellBits cells;
  const auto relative = [&](const Int3& c) {
    return Int3{c[0] - corner[0], c[1] - corner[1], c[2] - corner[2]};
  };
  for (const ClosingLeaf& leaf : known) cells.leaf(relative(leaf.origin)) = leaf.cells;
  std::vector<Int3> open;
  for (const Int3& seed : seeds) open.push_back(relative(seed));
  GrownCells out;
  while (!open.empty()) {
    const Int3 c = open.back();
    open.pop_back();
    assert(CellBits::holds(c));
    if (cells.has(c)) continue;
    const BrickNodes::Cell cell = nodes.cell(c);
    if (cell.local || !is_mixed(cell.inside, 0xff)) continue;
    if (cell.far) {
      out.stopped.push_back({c[0] + corner[0], c[1] + corner[1], c[2] + corner[2]});
      continue;
    }
    cells.set(c);
    ++out.added;
    for (std::size_t face = 0; face < 6; ++face) {
      if (!is_mixed(cell.inside, kFaceCorners[face])) continue;
      const Int3 n = neighbour(c, face);
      if (CellBits::holds(n)) {
        if (!cells.has(n)) open.push_back(n);
      } else {
        out.leaving.push_back({n[0] + corner[0], n[1] + corner[1], n[2] + corner[2]});
      }
    }
  }
  out.cells = cells.collect(corner);
  out.evaluated = nodes.evaluated();
  return out;
}

std::uint64_t take_back_unfinished(std::map<std::uint64_t, std::vector<ClosingLeaf>>& bricks,
                                   std::span<const Int3> stopped) {
  /// Clears the bit of a closing cell; false if it is none.
  const auto clear = [&](const Int3& c) {
    for (const int v : c)
      if (v < 0) return false;
    const auto brick = bricks.find(brick_key({c[0] >> kBrickBits, c[1] >> kBrickBits, c[2] >> kBrickBits}));
    if (brick == bricks.end()) return false;
    const Int3 origin = {c[0] & ~(kLeafCells - 1), c[1] & ~(kLeafCells - 1), c[2] & ~(kLeafCells - 1)};
    const auto leaf =
        std::lower_bound(brick->second.begin(), brick->second.end(), origin,
                         [](const ClosingLeaf& l, const Int3& o) { return before(l.origin, o); });
    if (leaf == brick->second.end() || leaf->origin != origin) return false;
    std::uint64_t& word = leaf->cells[static_cast<std::size_t>(c[2] & 7)];
    const std::uint64_t bit = std::uint64_t{1} << ((c[0] & 7) + 8 * (c[1] & 7));
    const bool was = (word & bit) != 0;
    word &= ~bit;
    return was;
  };
  std::uint64_t taken = 0;
  std::vector<Int3> open(stopped.begin(), stopped.end());
  while (!open.empty()) {
    const Int3 c = open.back();
    open.pop_back();
    for (std::size_t face = 0; face < 6; ++face) {
      const Int3 n = neighbour(c, face);
      if (!clear(n)) continue;
      ++taken;
      open.push_back(n);
    }
  }
  for (auto& [key, leaves] : bricks)
    std::erase_if(leaves, [](const ClosingLeaf& leaf) {
      return std::all_of(leaf.cells.begin(), leaf.cells.end(), [](std::uint64_t w) { return w == 0; });
    });
  return taken;
}

}  // namespace tessera
