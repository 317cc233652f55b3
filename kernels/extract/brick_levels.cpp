#include "kernels/extract/brick_levels.h"

#include <algorithm>
#include <cmath>

#include "kernels/field/edge_roots.h"

namespace tessera {
namespace {

constexpr Int3 kPoint = {0, 0, 0};

/// First and last of the three bricks (0 before, 1 at, 2 beyond) along one axis that touch [low, low + size].
std::array<std::size_t, 2> touched(int low, int size, int edge) {
  if (size > 0) {
    const std::size_t at = low < 0 ? 0 : low >= edge ? 2 : 1;
    return {at, at};
  }
  return {low <= 0 ? std::size_t{0} : low <= edge ? 1u : 2u, low < 0 ? std::size_t{0} : low < edge ? 1u : 2u};
}

Int3 along(std::size_t axis, int length) {
  Int3 size = {0, 0, 0};
  size[axis] = length;
  return size;
}

Int3 plus(const Int3& a, const Int3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

Int3 in_block(const Int3& node) {
  return {node[0] + kLevelMargin, node[1] + kLevelMargin, node[2] + kLevelMargin};
}

std::uint64_t bit_of(const Int3& n) {
  return std::uint64_t{1} << DirectedField::bit(n[0], n[1]);
}

const BandLeaf* leaf_of(const DirectedField& field, const Int3& node) {
  if (field.leaf_index.empty()) return nullptr;
  const Int3 n = in_block(node);
  return field.leaf_at(n[0], n[1], n[2]);
}

bool moves(const DirectedField& field, const Int3& node, std::size_t axis) {
  const BandLeaf* leaf = leaf_of(field, node);
  const Int3 n = in_block(node);
  return leaf && (leaf->moving[axis][static_cast<std::size_t>(n[2] & 7)] & bit_of(n)) != 0;
}

/// Where the signs of the two nodes of an edge are not those from which its root was made.
EdgeRoot straight_root(const LevelPair::Node& from, const LevelPair::Node& to, std::size_t axis) {
  const float a = from.small ? 0.5f * from.value : from.value, b = to.small ? 0.5f * to.value : to.value;
  EdgeRoot root;
  root.t = std::clamp(a == b ? 0.5f : a / (a - b), kRootMargin, 1.0f - kRootMargin);
  root.normal[axis] = from.inside ? 1.0f : -1.0f;
  return root;
}

/// Builds the mixed field leaf by leaf.
class Mixer {
 public:
  Mixer(const LevelFields& fields, const LevelSurroundings& around)
      : fields_(fields),
        around_(around),
        finer_(fields.own, fields.finer, around, 2 * kBrickCells, -1),
        coarser_(fields.coarser, fields.own, around, kBrickCells, 0) {}

  DirectedField mix() {
    for (std::size_t a = 0; a < 3; ++a) {
      out_.origin[a] = fields_.own.origin[a] + kLevelMargin;
      out_.cells[a] = kBrickCells;
    }
    const Int3 d = out_.leaf_dims();
    out_.leaf_index.assign(static_cast<std::size_t>(d[0] * d[1] * d[2]), -1);
    std::size_t slot = 0;
    for (int k = -1; k < d[2] - 1; ++k)
      for (int j = -1; j < d[1] - 1; ++j)
        for (int i = -1; i < d[0] - 1; ++i, ++slot) add_leaf({8 * i, 8 * j, 8 * k}, slot);
    for (BandLeaf& leaf : out_.leaves) find_roots(leaf);
    return std::move(out_);
  }

 private:
  LevelPair::Node node(const Int3& n) const {
    const int minimum = around_.touching(n, kPoint, kBrickCells).minimum;
    if (minimum > 0) return {};  // amid coarser cells
    return minimum == 0 ? node_of(fields_.own, n) : finer_.node({2 * n[0], 2 * n[1], 2 * n[2]});
  }

  /// Calls use(node, word, bit) for what lies in [-1, last] of the leaf.
  template <class Use>
  static void for_nodes(const Int3& origin, int last, const Use& use) {
    Int3 low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::max(-1, origin[a]);
      high[a] = std::min(last, origin[a] + kLeafCells - 1);
    }
    for (int z = low[2]; z <= high[2]; ++z)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int x = low[0]; x <= high[0]; ++x) {
          const Int3 n = {x, y, z};
          use(n, static_cast<std::size_t>(z & 7), bit_of(n));
        }
  }

  /// Whether all nodes and cells of the leaf are of the brick's level and touch no other.
  bool is_plain(const Int3& origin) const {
    LevelSurroundings::Range all = {0, 0};
    for (int c = 0; c < 8; ++c) {
      Int3 corner = origin;
      for (std::size_t a = 0; a < 3; ++a)
        corner[a] = c >> a & 1 ? std::min(origin[a] + kLeafCells, kBrickCells + 1) : std::max(origin[a], -1);
      const LevelSurroundings::Range at = around_.touching(corner, kPoint, kBrickCells);
      all = {std::min(all.minimum, at.minimum), std::max(all.maximum, at.maximum)};
    }
    return all.minimum == 0 && all.maximum == 0;
  }

  void add_leaf(const Int3& origin, std::size_t slot) {
    BandLeaf leaf(out_.origin, origin);
    const BandLeaf* own = leaf_of(fields_.own, origin);
    const bool plain = is_plain(origin);
    if (plain && !own) return;
    LeafWords valid{};
    bool any = false;
    for_nodes(origin, kBrickCells + 1, [&](const Int3& n, std::size_t word, std::uint64_t bit) {
      const LevelPair::Node found = plain ? node_of(fields_.own, n) : node(n);
      if (!found.valid) return;
      any = true;
      valid[word] |= bit;
      leaf.value(BandLeaf::node(n[0], n[1], n[2])) = found.small ? 0.5f * found.value : found.value;
      if (found.inside) leaf.inside[word] |= bit;
    });
    leaf.set_valid(valid);
    if (plain) {
      leaf.ended = own->ended;
      leaf.unseen = own->unseen;
    } else {
      for_nodes(origin, kBrickCells, [&](const Int3& cell, std::size_t word, std::uint64_t bit) {
        any |= mark_cell(cell, own, leaf, word, bit);
      });
    }
    if (!any) return;
    out_.leaf_index[slot] = static_cast<std::int32_t>(out_.leaves.size());
    out_.leaves.push_back(std::move(leaf));
  }

  /// \return whether it takes part in a coarser brick
  bool mark_cell(const Int3& cell, const BandLeaf* own, BandLeaf& leaf, std::size_t word,
                 std::uint64_t bit) const {
    const int step = around_.touching(cell, {1, 1, 1}, kBrickCells).minimum;
    const auto mark = [&](LeafWords& words, bool on) { words[word] = (words[word] & ~bit) | (on ? bit : 0); };
    if (step < 0) {
      mark(leaf.ended, true);
      return false;
    }
    if (step > 0) {
      const bool part = coarser_.takes_part({cell[0] & ~1, cell[1] & ~1, cell[2] & ~1});
      mark(leaf.ended, true);
      mark(leaf.closing, part);
      mark(leaf.quiet, true);
      return part;
    }
    const Int3 doubled = {2 * cell[0], 2 * cell[1], 2 * cell[2]};
    const bool transition = finer_.is_transition(doubled);
    mark(leaf.quiet, transition);
    mark(leaf.unseen, own && (own->unseen[word] & bit) != 0);
    mark(leaf.ended, transition ? !finer_.takes_part(doubled) : own && (own->ended[word] & bit) != 0);
    return false;
  }

  void find_roots(BandLeaf& leaf) {
    const LeafWords valid = leaf.valid();
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::size_t z = 0; z < 8; ++z) {
        leaf.first_root[axis][z] = static_cast<std::uint32_t>(out_.roots.size());
        for (std::uint64_t left = valid[z]; left; left &= left - 1) {
          const auto b = static_cast<int>(std::countr_zero(left));
          const Int3 n = {leaf.origin[0] + (b & 7), leaf.origin[1] + (b >> 3),
                          leaf.origin[2] + static_cast<int>(z)};
          if (n[axis] > kBrickCells) continue;
          find_root(n, axis, leaf);
        }
      }
  }

  void find_root(const Int3& n, std::size_t axis, BandLeaf& leaf) {
    const Int3 end = plus(n, along(axis, 1));
    const Int3 at = end;
    const BandLeaf* other = out_.leaf_at(at[0], at[1], at[2]);
    if (!other || !other->is_valid(BandLeaf::node(end[0], end[1], end[2]))) return;
    const auto word = static_cast<std::size_t>(n[2] & 7), end_word = static_cast<std::size_t>(end[2] & 7);
    const bool from = (leaf.inside[word] & bit_of(n)) != 0, to = (other->inside[end_word] & bit_of(end)) != 0;
    if (from == to) return;
    const LevelSurroundings::Range levels = around_.touching(n, along(axis, 1), kBrickCells);
    if (levels.minimum != 0) return;  // split, or amid coarser cells
    leaf.crossing[axis][word] |= bit_of(n);
    const auto index = static_cast<std::uint32_t>(out_.roots.size());
    const Int3 b = in_block(n);
    const EdgeRoot* found = fields_.own.root_at(b[0], b[1], b[2], static_cast<int>(axis));
    const bool kept = found && node_of(fields_.own, n).inside == from;
    const auto old = static_cast<std::uint32_t>(kept ? found - fields_.own.roots.data() : 0);
    out_.roots.push_back(kept ? *found : straight_root(node(n), node(end), axis));
    if (fields_.noisy) out_.creased.push_back(kept ? fields_.own.creased[old] : std::uint8_t{0});
    if (!kept || levels.maximum != 0 || !moves(fields_.own, n, axis)) return;
    leaf.moving[axis][word] |= bit_of(n);
    leaf.any_moving = true;
    const auto& all = fields_.own.moves;
    const auto move = std::lower_bound(all.begin(), all.end(), old,
                                       [](const BorderMove& m, std::uint32_t r) { return m.root < r; });
    if (move != all.end() && move->root == old) out_.moves.push_back({index, move->by});
  }

  const LevelFields& fields_;
  const LevelSurroundings& around_;
  LevelPair finer_, coarser_;
  DirectedField out_;
};

}  // namespace

LevelSurroundings::Range LevelSurroundings::touching(const Int3& low, const Int3& size, int edge) const {
  return among(
      {touched(low[0], size[0], edge), touched(low[1], size[1], edge), touched(low[2], size[2], edge)});
}

LevelSurroundings::Range LevelSurroundings::among(
    const std::array<std::array<std::size_t, 2>, 3>& bricks) const {
  Range out = {1, -1};
  for (std::size_t k = bricks[2][0]; k <= bricks[2][1]; ++k)
    for (std::size_t j = bricks[1][0]; j <= bricks[1][1]; ++j)
      for (std::size_t i = bricks[0][0]; i <= bricks[0][1]; ++i) {
        const int s = step[i + 3 * j + 9 * k];
        out = {std::min(out.minimum, s), std::max(out.maximum, s)};
      }
  return out;
}

bool wanted_own(const LevelSurroundings& around, const Int3& node) {
  const int margin = around.has(1) ? 2 : 1;
  for (const int c : node)
    if (c < -margin || c > kBrickCells + margin) return false;
  return true;
}

bool wanted_finer(const LevelSurroundings& around, const Int3& node) {
  // Cells of the brick and its halo that touch finer bricks, and the finer cells across.
  constexpr int kEdge = 2 * kBrickCells;
  bool near = false;
  std::array<std::array<std::size_t, 2>, 3> bricks;
  for (std::size_t a = 0; a < 3; ++a) {
    const int c = node[a];
    if (c < -3 || c > kEdge + 3) return false;
    near = near || c <= 1 || c >= kEdge - 1;
    bricks[a] = {touched(c - 1, 0, kEdge)[0], touched(c + 1, 0, kEdge)[1]};
  }
  if (!near) return false;
  const LevelSurroundings::Range range = around.among(bricks);
  return range.minimum < 0 && range.maximum >= 0;
}

bool wanted_coarser(const LevelSurroundings& around, const Int3& node) {
  for (const int c : node)
    if (c < -1 || c > kBrickCells / 2 + 1) return false;
  return around.touching(node, kPoint, kBrickCells / 2).maximum > 0;
}

bool may_want_finer(const LevelSurroundings& around, const Int3& low, const Int3& high) {
  std::array<std::array<std::size_t, 2>, 3> bricks;
  for (std::size_t a = 0; a < 3; ++a)
    bricks[a] = {touched(low[a] - 1, 0, 2 * kBrickCells)[0], touched(high[a] + 1, 0, 2 * kBrickCells)[1]};
  const LevelSurroundings::Range range = around.among(bricks);
  return range.minimum < 0 && range.maximum >= 0;
}

bool may_want_coarser(const LevelSurroundings& around, const Int3& low, const Int3& high) {
  std::array<std::array<std::size_t, 2>, 3> bricks;
  for (std::size_t a = 0; a < 3; ++a)
    bricks[a] = {touched(low[a], 0, kBrickCells / 2)[0], touched(high[a], 0, kBrickCells / 2)[1]};
  return around.among(bricks).maximum > 0;
}

DirectedField mix_levels(const LevelFields& fields, const LevelSurroundings& around) {
  return Mixer(fields, around).mix();
}

LevelPair::Node node_of(const DirectedField& field, const Int3& node) {
  const BandLeaf* leaf = leaf_of(field, node);
  if (!leaf) return {};
  const Int3 n = in_block(node);
  const std::size_t at = BandLeaf::node(n[0], n[1], n[2]);
  if (!leaf->is_valid(at)) return {};
  return {true, (leaf->inside[static_cast<std::size_t>(n[2] & 7)] & bit_of(n)) != 0, leaf->value(at), false};
}

bool whole_cell(const DirectedField& field, const Int3& cell) {
  for (int c = 0; c < 8; ++c)
    if (!node_of(field, {cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)}).valid) return false;
  const Int3 n = in_block(cell);
  return (leaf_of(field, cell)->ended[static_cast<std::size_t>(n[2] & 7)] & bit_of(n)) == 0;
}

LevelPair::Node LevelPair::node(const Int3& at) const {
  const Int3 half = {at[0] >> 1, at[1] >> 1, at[2] >> 1};
  if (!is_split(at, kPoint)) return node_of(big_, half);
  Node found = node_of(small_, at);
  found.small = true;
  if (found.valid) return found;
  // A node of the big lattice, or amid an edge or a face of it: what two of its cells see both of them take for the same.
  const int odd = (at[0] & 1) + (at[1] & 1) + (at[2] & 1);
  if (odd == 3) return {};
  if (odd == 0) {
    found = node_of(big_, half);
  } else {
    bool any = false;
    for (std::size_t a = 0; a < 3; ++a) {
      if ((at[a] & 1) == 0) continue;
      for (const int side : {-1, 1}) {
        const Node beside = node(plus(at, along(a, side)));
        if (!beside.valid || (any && beside.inside != found.inside)) return {};
        found = beside;
        any = true;
      }
    }
  }
  found.small = false;
  found.stands_in = true;
  return found;
}

bool LevelPair::is_transition(const Int3& cell) const {
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 4; ++side) {
      Int3 low = cell;
      low[(axis + 1) % 3] += side & 1 ? 2 : 0;
      low[(axis + 2) % 3] += side & 2 ? 2 : 0;
      if (is_split(low, along(axis, 2))) return true;
    }
  return false;
}

bool LevelPair::takes_part(const Int3& cell) const {
  for (int c = 0; c < 8; ++c)
    if (!node({cell[0] + 2 * (c & 1), cell[1] + (c & 2), cell[2] + 2 * (c >> 2)}).valid) return false;
  bool vertex = false, deep = false;
  bool lost = false;
  const auto edge = [&](const Int3& low, std::size_t axis, int length) {
    const Node from = node(low), to = node(plus(low, along(axis, length)));
    if (from.inside == to.inside) return;
    lost = lost || (length == 1 && (from.stands_in || to.stands_in));  // it has no root
    vertex = true;
    deep = deep || !(length == 1 ? moves(small_, low, axis)
                                 : moves(big_, {low[0] >> 1, low[1] >> 1, low[2] >> 1}, axis));
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (int side = 0; side < 4; ++side) {
      Int3 low = cell;
      low[u] += side & 1 ? 2 : 0;
      low[v] += side & 2 ? 2 : 0;
      if (!is_split(low, along(axis, 2))) {
        edge(low, axis, 2);
        continue;
      }
      const Int3 middle = plus(low, along(axis, 1));
      if (!node(middle).valid) return false;
      edge(low, axis, 1);
      edge(middle, axis, 1);
    }
    for (int side = 0; side < 2; ++side) {  // faces across the axis
      Int3 low = cell;
      low[axis] += 2 * side;
      Int3 size = {2, 2, 2};
      size[axis] = 0;
      if (!is_split(low, size)) continue;
      const Int3 middle = plus(plus(low, along(u, 1)), along(v, 1));
      if (!node(middle).valid) return false;
      for (const std::size_t a : {u, v}) {
        edge(middle, a, 1);
        edge(plus(middle, along(a, -1)), a, 1);
      }
    }
  }
  return !lost && (deep || !vertex);
}

}  // namespace tessera
