#include "kernels/closing/closing.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "kernels/field/edge_roots.h"
#include "kernels/field/node_fit.h"

namespace tessera {
namespace {

/// So that it has a sign, cells.
constexpr float kMinFlowValue = 0.01f;

/// Index of a leaf in the dense table of the field; -1 outside.
std::int64_t slot_of(const DirectedField& field, const Int3& leaf) {
  const Int3 d = field.leaf_dims();
  for (std::size_t a = 0; a < 3; ++a)
    if (leaf[a] < -1 || leaf[a] > d[a] - 2) return -1;
  return (static_cast<std::int64_t>(leaf[2] + 1) * d[1] + (leaf[1] + 1)) * d[0] + (leaf[0] + 1);
}

/// Nodes that a leaf's cells have in the leaf at offset (dx, dy, dz) of 0 or 1.
LeafWords corners_in(const LeafWords& cells, int dx, int dy, int dz) {
  LeafWords out{};
  const auto spread_x = [&](std::uint64_t w) {
    constexpr std::uint64_t kLow = 0x0101010101010101ULL;
    return dx ? (w >> 7) & kLow : w | (w << 1 & ~kLow);
  };
  const auto spread_y = [&](std::uint64_t w) { return dy ? w >> 56 : w | w << 8; };
  for (std::size_t z = 0; z < 8; ++z) {
    const std::uint64_t w = spread_y(spread_x(cells[z]));
    if (dz) {
      if (z == 7) out[0] |= w;
    } else {
      out[z] |= w;
      if (z < 7) out[z + 1] |= w;
    }
  }
  return out;
}

struct WantedNodes {
  LeafWords nodes{};
  LeafWords cells{};
  const ClosingLeaf* flow = nullptr;  ///< with forced nodes
  LeafWords loosened{};               ///< nodes that were the local field's and are forced
  bool any = false;
};

/// Values at the wanted nodes of a leaf where the local field has none.
void evaluate_nodes(BandLeaf& leaf, const Int3& block, const WantedNodes& want, const ClosingField& field,
                    const ClosingOptions& options) {
  const LeafWords& wanted = want.nodes;
  std::vector<Int3> queries;
  std::vector<std::size_t> nodes;
  const LeafWords valid = leaf.valid();
  for (std::size_t z = 0; z < 8; ++z)
    for (std::uint64_t left = wanted[z] & ~valid[z]; left; left &= left - 1) {
      const auto b = static_cast<std::size_t>(std::countr_zero(left));
      const Int3 at = {block[0] + leaf.origin[0] + static_cast<int>(b & 7),
                       block[1] + leaf.origin[1] + static_cast<int>(b >> 3),
                       block[2] + leaf.origin[2] + static_cast<int>(z)};
      bool bounded = true;
      for (std::size_t a = 0; a < 3; ++a) bounded &= at[a] > options.low[a] && at[a] < options.high[a];
      if (!bounded) {
        const bool inside = options.level < 0.0f;
        leaf.value(b + 64 * z) = inside ? -kLargestValue : kLargestValue;
        if (inside) leaf.inside[z] |= std::uint64_t{1} << b;
        continue;
      }
      nodes.push_back(b + 64 * z);
      queries.push_back({at[0] * kQuantaPerCell, at[1] * kQuantaPerCell, at[2] * kQuantaPerCell});
    }
  std::vector<float> value(queries.size());
  field.evaluate(queries, options.level, value);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const std::size_t z = nodes[i] >> 6;
    const std::uint64_t bit = std::uint64_t{1} << (nodes[i] & 63);
    float v = value[i];
    if (want.flow && (want.flow->near[z] & bit)) {
      // A node beside forced ones keeps its sign, if not its value.
      const bool inside = want.flow->forced[z] & bit ? (want.flow->inside[z] & bit) != 0 : v < 0.0f;
      const float size = std::abs(static_cast<float>(want.flow->value[nodes[i]])) / kFlowSteps;
      v = inside ? -std::max(size, kMinFlowValue) : size;
    }
    v = std::clamp(v, -kLargestValue, kLargestValue);
    leaf.value(nodes[i]) = v;
    if (v < 0.0f) leaf.inside[z] |= bit;
  }
}

/// Takes forced nodes from the local field.
void force_signs(DirectedField& field, const ClosingLeaf& cells, WantedNodes& want) {
  want.flow = &cells;
  Int3 at;
  for (std::size_t a = 0; a < 3; ++a) at[a] = (cells.origin[a] - field.origin[a]) >> kLeafBits;
  const std::int32_t index = field.leaf_index[static_cast<std::size_t>(slot_of(field, at))];
  if (index < 0) return;
  BandLeaf& leaf = field.leaves[static_cast<std::size_t>(index)];
  LeafWords valid = leaf.valid();
  for (std::size_t z = 0; z < 8; ++z) {
    want.loosened[z] = valid[z] & cells.forced[z];
    valid[z] &= ~cells.forced[z];
    leaf.inside[z] &= ~want.loosened[z];
  }
  leaf.set_valid(valid);
}

/// Roots of all edges of the band anew: the local ones as they were, and those of closing cells.
class RootMerger {
 public:
  RootMerger(DirectedField& field, const std::vector<WantedNodes>& wanted) : field_(field), wanted_(wanted) {}

  void run() {
    for (std::size_t l = 0; l < field_.leaves.size(); ++l)
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (std::size_t z = 0; z < 8; ++z) merge_word(l, axis, z);
    field_.roots = std::move(roots_);
    field_.creased = std::move(creased_);
  }

 private:
  void merge_word(std::size_t l, std::size_t axis, std::size_t z) {
    BandLeaf& leaf = field_.leaves[l];
    const std::uint64_t all_old = leaf.crossing[axis][z];
    const std::uint64_t old = all_old & ~loosened_edges(l, axis, z);
    const std::uint32_t first_old = leaf.first_root[axis][z];
    leaf.first_root[axis][z] = static_cast<std::uint32_t>(roots_.size());
    std::uint64_t now = old;
    std::array<EdgeRoot, 64> fresh;
    for (std::uint64_t left = wanted_[l].nodes[z] & ~old; left; left &= left - 1) {
      const auto b = static_cast<std::size_t>(std::countr_zero(left));
      if (closing_root(l, axis, z, b, fresh[b])) now |= std::uint64_t{1} << b;
    }
    for (std::uint64_t left = now; left; left &= left - 1) {
      const auto b = static_cast<std::size_t>(std::countr_zero(left));
      const std::uint64_t below = (std::uint64_t{1} << b) - 1;
      const bool kept = (old >> b & 1) != 0;
      const std::size_t from = first_old + static_cast<std::size_t>(std::popcount(all_old & below));
      roots_.push_back(kept ? field_.roots[from] : fresh[b]);
      if (!field_.creased.empty()) creased_.push_back(kept ? field_.creased[from] : std::uint8_t{0});
    }
    leaf.crossing[axis][z] = now;
  }

  /// The leaf after this one along the axis; none: size of the list.
  std::size_t next_leaf(std::size_t l, std::size_t axis) const {
    const BandLeaf& leaf = field_.leaves[l];
    Int3 next = {leaf.origin[0] >> kLeafBits, leaf.origin[1] >> kLeafBits, leaf.origin[2] >> kLeafBits};
    ++next[axis];
    const std::int64_t slot = slot_of(field_, next);
    if (slot < 0 || field_.leaf_index[static_cast<std::size_t>(slot)] < 0) return field_.leaves.size();
    return static_cast<std::size_t>(field_.leaf_index[static_cast<std::size_t>(slot)]);
  }

  /// Edges with an end that is the local field's no more.
  std::uint64_t loosened_edges(std::size_t l, std::size_t axis, std::size_t z) const {
    const LeafWords& own = wanted_[l].loosened;
    const std::size_t next = next_leaf(l, axis);
    const LeafWords beyond = next < wanted_.size() ? wanted_[next].loosened : LeafWords{};
    constexpr std::uint64_t kLast = 0x8080808080808080ULL;
    if (axis == 0) return own[z] | (own[z] >> 1 & ~kLast) | (beyond[z] << 7 & kLast);
    if (axis == 1) return own[z] | own[z] >> 8 | beyond[z] << 56;
    return own[z] | (z < 7 ? own[z + 1] : beyond[0]);
  }

  /// The edge from a wanted node to the next along the axis, if that is wanted too and differs in sign.
  bool closing_root(std::size_t l, std::size_t axis, std::size_t z, std::size_t b, EdgeRoot& root) const {
    Int3 to = {static_cast<int>(b & 7), static_cast<int>(b >> 3), static_cast<int>(z)};
    ++to[axis];
    std::size_t other = l;
    if (to[axis] == kLeafCells) {
      to[axis] = 0;
      other = next_leaf(l, axis);
      if (other == field_.leaves.size()) return false;
    }
    const auto to_z = static_cast<std::size_t>(to[2]);
    const auto to_b = static_cast<std::size_t>(to[0] + 8 * to[1]);
    // Masks, not shifts: GCC 12 compares (a >> b & 1) == (c >> d & 1) wrongly here.
    const std::uint64_t from_bit = std::uint64_t{1} << b, to_bit = std::uint64_t{1} << to_b;
    if ((wanted_[other].nodes[to_z] & to_bit) == 0) return false;
    const bool inside = (field_.leaves[l].inside[z] & from_bit) != 0;
    const bool to_inside = (field_.leaves[other].inside[to_z] & to_bit) != 0;
    if (inside == to_inside) return false;
    const float from_value = std::abs(field_.leaves[l].value(b + 64 * z));
    const float to_value = std::abs(field_.leaves[other].value(to_b + 64 * to_z));
    const float sum = from_value + to_value;
    root = EdgeRoot{};
    root.t = std::clamp(sum > 0.0f ? from_value / sum : 0.5f, kRootMargin, 1.0f - kRootMargin);
    root.normal[axis] = inside ? 1.0f : -1.0f;  // closing cells look for no features: never read
    return true;
  }

  DirectedField& field_;
  const std::vector<WantedNodes>& wanted_;
  std::vector<EdgeRoot> roots_;
  std::vector<std::uint8_t> creased_;
};

}  // namespace

void add_closing(DirectedField& field, std::span<const ClosingLeaf> cells, const ClosingField& closing,
                 const ClosingOptions& options) {
  std::vector<WantedNodes> wanted(field.leaf_index.size());
  for (const ClosingLeaf& c : cells) {
    Int3 leaf;
    for (std::size_t a = 0; a < 3; ++a) leaf[a] = (c.origin[a] - field.origin[a]) >> kLeafBits;
    LeafWords used = c.cells;  // of a leaf below the block, the last layer of cells
    const std::int64_t own = slot_of(field, leaf);
    if (own < 0) continue;
    force_signs(field, c, wanted[static_cast<std::size_t>(own)]);
    bool core = true;
    for (std::size_t a = 0; a < 3; ++a) core &= leaf[a] * kLeafCells < field.cells[a];
    if (!core) {  // cells above the block: only that they take part is of interest
      wanted[static_cast<std::size_t>(own)].cells = c.cells;
      continue;
    }
    for (std::size_t z = 0; z < 8; ++z) {
      if (leaf[0] < 0) used[z] &= 0x8080808080808080ULL;
      if (leaf[1] < 0) used[z] &= 0xff00000000000000ULL;
      if (leaf[2] < 0 && z != 7) used[z] = 0;
    }
    for (int d = 0; d < 8; ++d) {
      const std::int64_t slot =
          slot_of(field, {leaf[0] + (d & 1), leaf[1] + (d >> 1 & 1), leaf[2] + (d >> 2)});
      assert(slot >= 0);
      const LeafWords nodes = corners_in(used, d & 1, d >> 1 & 1, d >> 2);
      WantedNodes& w = wanted[static_cast<std::size_t>(slot)];
      for (std::size_t z = 0; z < 8; ++z) {
        w.nodes[z] |= nodes[z];
        w.any |= nodes[z] != 0;
        if (d == 0) w.cells[z] |= used[z];
      }
    }
  }
  // Leaves in table order, the new ones among them.
  std::vector<BandLeaf> leaves;
  std::vector<WantedNodes> of_leaf;
  const Int3 dims = field.leaf_dims();
  for (std::size_t slot = 0; slot < wanted.size(); ++slot) {
    const std::int32_t old = field.leaf_index[slot];
    if (old < 0 && !wanted[slot].any) continue;
    field.leaf_index[slot] = static_cast<std::int32_t>(leaves.size());
    if (old >= 0) {
      leaves.push_back(std::move(field.leaves[static_cast<std::size_t>(old)]));
    } else {
      const auto s = static_cast<int>(slot);
      leaves.emplace_back(field.origin,
                          Int3{(s % dims[0] - 1) * kLeafCells, (s / dims[0] % dims[1] - 1) * kLeafCells,
                               (s / (dims[0] * dims[1]) - 1) * kLeafCells});
    }
    leaves.back().closing = wanted[slot].cells;
    of_leaf.push_back(wanted[slot]);
  }
  field.leaves = std::move(leaves);
  for (std::size_t l = 0; l < of_leaf.size(); ++l)
    if (of_leaf[l].any) evaluate_nodes(field.leaves[l], field.origin, of_leaf[l], closing, options);
  RootMerger(field, of_leaf).run();
}

}  // namespace tessera
