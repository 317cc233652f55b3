#include "kernels/solid/solid_field.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

#include "kernels/field/band.h"
#include "kernels/field/edge_roots.h"

namespace tessera {
namespace {

constexpr std::size_t kLeafNodes = 512;
constexpr float kInside = 0.5f;
/// Least cosine between the normals around a node from which roots slide.
constexpr float kSlideCosine = 0.95f;

/// Leaves whose nodes belong to a cell at one of the crossings.
void need_leaves(const SolidBlock& block, std::size_t slot, std::size_t axis, std::size_t node,
                 std::vector<std::uint8_t>& needed) {
  const Int3 at = {static_cast<int>(node & 7), static_cast<int>(node >> 3 & 7), static_cast<int>(node >> 6)};
  Int3 low, high;
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = k == axis || at[k] > 0 ? 0 : -1;
    high[k] = at[k] < 7 ? 0 : 1;
  }
  needed[slot] = 1;
  if (low == Int3{0, 0, 0} && high == Int3{0, 0, 0}) return;
  const Int3 leaf = block.leaf(slot);
  const Int3 dims = block.dims();
  for (int z = low[2]; z <= high[2]; ++z)
    for (int y = low[1]; y <= high[1]; ++y)
      for (int x = low[0]; x <= high[0]; ++x) {
        const Int3 other = {leaf[0] + x, leaf[1] + y, leaf[2] + z};
        bool there = true;
        for (std::size_t k = 0; k < 3; ++k) there = there && other[k] >= -1 && other[k] <= dims[k] - 2;
        if (there) needed[block.slot(other)] = 1;
      }
}

class Builder {
 public:
  Builder(const SolidBlock& block, std::vector<SolidCrossing>&& crossings,
          std::span<const SolidOperand* const> operands, const SolidTree& tree, SolidFieldReport& report)
      : block_(block),
        crossings_(std::move(crossings)),
        operands_(operands),
        tree_(tree),
        report_(report),
        regions_(operands.size()) {
    std::sort(crossings_.begin(), crossings_.end());
    field_.origin = block.origin;
    field_.cells = block.cells;
  }

  DirectedField build(std::span<const Int3> closing, const std::function<void()>& pause) {
    choose_leaves(closing);
    for (std::size_t l = 0; l < field_.leaves.size(); ++l) {
      if (pause && l % 16 == 0) pause();
      sign(l);
    }
    std::size_t cursor = 0;
    for (std::size_t l = 0; l < field_.leaves.size(); ++l) {
      if (pause && l % 16 == 0) pause();
      for (std::size_t axis = 0; axis < 3; ++axis) find_roots(l, axis, cursor);
    }
    set_values();
    return std::move(field_);
  }

 private:
  void choose_leaves(std::span<const Int3> closing) {
    std::vector<std::uint8_t> needed(block_.slots(), 0);
    std::uint32_t last = ~0u;
    for (const SolidCrossing& c : crossings_) {
      if (c.edge == last) continue;
      last = c.edge;
      const std::size_t rest = c.edge / kLeafNodes;
      need_leaves(block_, rest / 3, rest % 3, c.edge % kLeafNodes, needed);
    }
    for (const Int3& leaf : closing) needed[block_.slot(leaf)] = 1;
    field_.leaf_index.assign(block_.slots(), -1);
    for (std::size_t s = 0; s < needed.size(); ++s) {
      if (!needed[s]) continue;
      const Int3 leaf = block_.leaf(s);
      field_.leaf_index[s] = static_cast<std::int32_t>(field_.leaves.size());
      BandLeaf& made = field_.leaves.emplace_back(block_.origin, Int3{8 * leaf[0], 8 * leaf[1], 8 * leaf[2]});
      made.set_valid(nodes_in_block(leaf, block_.cells));
      slot_.push_back(s);
    }
    windings_.resize(field_.leaves.size() * operands_.size() * kLeafNodes);
  }

  std::span<float> windings(std::size_t leaf, std::size_t operand) {
    return {windings_.data() + (leaf * operands_.size() + operand) * kLeafNodes, kLeafNodes};
  }

  void sign(std::size_t l) {
    BandLeaf& leaf = field_.leaves[l];
    const Int3 at = {(block_.origin[0] + leaf.origin[0]) >> kLeafBits,
                     (block_.origin[1] + leaf.origin[1]) >> kLeafBits,
                     (block_.origin[2] + leaf.origin[2]) >> kLeafBits};
    const auto base = static_cast<std::uint32_t>(slot_[l] * 3 * kLeafNodes);
    const auto by_edge = [](const SolidCrossing& c, std::uint32_t edge) { return c.edge < edge; };
    const auto first = std::lower_bound(crossings_.begin(), crossings_.end(), base, by_edge);
    const auto last =
        std::lower_bound(first, crossings_.end(), base + static_cast<std::uint32_t>(3 * kLeafNodes), by_edge);
    std::vector<std::array<std::uint64_t, 8>> words(operands_.size());
    for (std::size_t o = 0; o < operands_.size(); ++o) {
      own_.clear();
      for (auto c = first; c != last; ++c)
        if (c->operand == o) own_.push_back(*c);
      const std::span<float> w = windings(l, o);
      operands_[o]->windings(at, own_, w, regions_[o]);
      for (std::size_t z = 0; z < 8; ++z) {
        words[o][z] = 0;
        for (std::size_t b = 0; b < 64; ++b)
          words[o][z] |= static_cast<std::uint64_t>(w[64 * z + b] > kInside) << b;
      }
    }
    const LeafWords valid = leaf.valid();
    for (std::size_t z = 0; z < 8; ++z) {
      states_.resize(operands_.size());
      for (std::size_t o = 0; o < operands_.size(); ++o) states_[o] = words[o][z];
      leaf.inside[z] = tree_.inside(states_) & valid[z];
    }
  }

  void find_roots(std::size_t l, std::size_t axis, std::size_t& cursor) {
    BandLeaf& leaf = field_.leaves[l];
    const std::size_t step = axis == 0 ? 1 : axis == 1 ? 8 : 64;
    const BandLeaf* other = field_.leaf_after(leaf, axis);
    const std::size_t next = other ? static_cast<std::size_t>(other - field_.leaves.data()) : l;
    const LeafWords valid = leaf.valid();
    const auto base = static_cast<std::uint32_t>((slot_[l] * 3 + axis) * kLeafNodes);
    for (std::size_t z = 0; z < 8; ++z) {
      leaf.first_root[axis][z] = static_cast<std::uint32_t>(field_.roots.size());
      std::uint64_t crossing = 0;
      for (std::size_t b = 0; b < 64; ++b) {
        const std::size_t a = b + 64 * z;
        const std::size_t coordinate = axis == 0 ? b & 7 : axis == 1 ? b >> 3 : z;
        const bool beyond = coordinate == 7;
        if (!(valid[z] >> b & 1) || (beyond && !other)) continue;
        const std::size_t e = beyond ? a - 7 * step : a + step;
        const BandLeaf& end = beyond ? *other : leaf;
        if (!end.is_valid(e)) continue;
        const bool in_a = leaf.inside[z] >> b & 1, in_e = end.inside[e >> 6] >> (e & 63) & 1;
        if (in_a == in_e) continue;
        crossing |= std::uint64_t{1} << b;
        while (cursor < crossings_.size() && crossings_[cursor].edge < base + a) ++cursor;
        add_root(l, a, next, beyond, e, axis, cursor, base + static_cast<std::uint32_t>(a));
      }
      leaf.crossing[axis][z] = crossing;
    }
  }

  std::uint64_t combined(const std::vector<float>& winding) {
    states_.resize(winding.size());
    for (std::size_t o = 0; o < winding.size(); ++o) states_[o] = winding[o] > kInside ? 1 : 0;
    return tree_.inside(states_) & 1;
  }

  void add_root(std::size_t l, std::size_t a, std::size_t next, bool beyond, std::size_t e, std::size_t axis,
                std::size_t cursor, std::uint32_t edge) {
    now_.resize(operands_.size());
    for (std::size_t o = 0; o < operands_.size(); ++o) now_[o] = windings(l, o)[a];
    const bool starts_inside = combined(now_) != 0;
    float t = 0.5f;
    Float3 normal = {0, 0, 0};
    bool found = false;
    for (; cursor < crossings_.size() && crossings_[cursor].edge == edge; ++cursor) {
      const SolidCrossing& c = crossings_[cursor];
      const float before = now_[c.operand];
      now_[c.operand] += static_cast<float>(c.winding);
      if (found || (combined(now_) != 0) == starts_inside) continue;
      t = c.t;
      normal = c.normal;
      found = true;
      if (operands_.size() == 1) {
        const float in = std::max(before, now_[c.operand]), out = std::min(before, now_[c.operand]);
        report_.shallow_roots += in < 0.75f || out > 0.25f;
      }
    }
    ++report_.roots;
    if (!found) {
      ++report_.membrane_roots;
      membrane_root(l, a, beyond ? next : l, e, axis, t, normal);
      mark_closing(l, a, axis);
    }
    const float outward = starts_inside ? 1.0f : -1.0f;
    if (normal[axis] * outward < 0.0f) normal = -normal;
    EdgeRoot root;
    root.normal = normal;
    root.t = std::clamp(t, kRootMargin, 1.0f - kRootMargin);
    root.offset = (t - root.t) * normal[axis];
    if (found && root.offset != 0.0f) {
      Int3 near = {field_.leaves[l].origin[0] + static_cast<int>(a & 7),
                   field_.leaves[l].origin[1] + static_cast<int>(a >> 3 & 7),
                   field_.leaves[l].origin[2] + static_cast<int>(a >> 6)};
      if (root.t > 0.5f) ++near[axis];
      root.slides = may_slide(near, normal);
    }
    field_.roots.push_back(root);
  }

  /// Of the first operand whose nodes differ.
  void membrane_root(std::size_t l, std::size_t a, std::size_t end_leaf, std::size_t e, std::size_t axis,
                     float& t, Float3& normal) {
    for (std::size_t o = 0; o < operands_.size(); ++o) {
      const float from = windings(l, o)[a], to = windings(end_leaf, o)[e];
      if ((from > kInside) == (to > kInside)) continue;
      t = (kInside - from) / (to - from);
      const BandLeaf& leaf = field_.leaves[l];
      Double3 p;
      for (std::size_t k = 0; k < 3; ++k)
        p[k] = block_.origin[k] + leaf.origin[k] + static_cast<int>(a >> (3 * k) & 7) +
               (k == axis ? double{t} : 0.0);
      normal = narrow(unit_or_zero(operands_[o]->membrane_normal(p)));
      break;
    }
    if (normal == Float3{0, 0, 0}) normal[axis] = 1.0f;
  }

  /// Whether all nodes of a cell are in the field; within the block, those around a root are.
  bool takes_part(const Int3& cell) {
    for (int c = 0; c < 8; ++c) {
      const Int3 n = {cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)};
      for (std::size_t k = 0; k < 3; ++k)
        if (n[k] < -1 || n[k] > block_.cells[k] + 1) return false;
      const BandLeaf* leaf = field_.leaf_at(n[0], n[1], n[2]);
      if (!leaf || !leaf->is_valid(BandLeaf::node(n[0], n[1], n[2]))) {
        ++report_.missing_nodes;
        return false;
      }
    }
    return true;
  }

  /// The four cells around an edge.
  void mark_closing(std::size_t l, std::size_t a, std::size_t axis) {
    const Int3 node = {field_.leaves[l].origin[0] + static_cast<int>(a & 7),
                       field_.leaves[l].origin[1] + static_cast<int>(a >> 3 & 7),
                       field_.leaves[l].origin[2] + static_cast<int>(a >> 6)};
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (int side = 0; side < 4; ++side) {
      Int3 cell = node;
      cell[u] -= side & 1;
      cell[v] -= side >> 1;
      if (!takes_part(cell)) continue;
      const std::int32_t at =
          field_.leaf_index[block_.slot({cell[0] >> kLeafBits, cell[1] >> kLeafBits, cell[2] >> kLeafBits})];
      field_.leaves[static_cast<std::size_t>(at)].closing[static_cast<std::size_t>(cell[2] & 7)] |=
          std::uint64_t{1} << DirectedField::bit(cell[0], cell[1]);
    }
  }

  /// The six edges of a node, relative to the block, as crossings name them: those from it, then those to it.
  std::array<std::uint32_t, 6> edges_of(const Int3& node) const {
    std::array<std::uint32_t, 6> edges;
    for (std::size_t e = 0; e < 6; ++e) {
      Int3 from = node;
      if (e >= 3) --from[e - 3];
      const std::size_t slot =
          block_.slot({from[0] >> kLeafBits, from[1] >> kLeafBits, from[2] >> kLeafBits});
      edges[e] = static_cast<std::uint32_t>((slot * 3 + e % 3) * kLeafNodes +
                                            BandLeaf::node(from[0], from[1], from[2]));
    }
    return edges;
  }

  /// Values decide ambiguous faces alone: the distance of the nearest tangent plane on the node's edges, else how far its
  /// winding numbers are from 1/2. Crossings beyond the block's nodes count too, so every block has the same.
  void set_values() {
    for (std::size_t l = 0; l < field_.leaves.size(); ++l)
      for (std::size_t o = 0; o < operands_.size(); ++o) {
        const std::span<const float> w = windings(l, o);
        for (std::size_t i = 0; i < kLeafNodes; ++i) {
          float& value = field_.leaves[l].value(i);
          value = std::min(value, 2.0f * std::fabs(w[i] - kInside));
        }
      }
    for (const SolidCrossing& c : crossings_) {
      const std::size_t slot = c.edge / (3 * kLeafNodes), axis = c.edge / kLeafNodes % 3,
                        node = c.edge % kLeafNodes;
      const Int3 leaf = block_.leaf(slot);
      Int3 at = {8 * leaf[0] + static_cast<int>(node & 7), 8 * leaf[1] + static_cast<int>(node >> 3 & 7),
                 8 * leaf[2] + static_cast<int>(node >> 6)};
      const float slope = std::fabs(c.normal[axis]);
      lower_value(at, slope * c.t);
      ++at[axis];
      lower_value(at, slope * (1.0f - c.t));
    }
    for (BandLeaf& leaf : field_.leaves)
      for (std::size_t z = 0; z < 8; ++z)
        for (std::uint64_t left = leaf.inside[z]; left; left &= left - 1) {
          float& value = leaf.value(static_cast<std::size_t>(std::countr_zero(left)) + 64 * z);
          value = -std::max(value, 1e-6f);
        }
  }
  void lower_value(const Int3& node, float value) {
    for (std::size_t k = 0; k < 3; ++k)
      if (node[k] > block_.cells[k] + 1) return;
    const std::int32_t at =
        field_.leaf_index[block_.slot({node[0] >> kLeafBits, node[1] >> kLeafBits, node[2] >> kLeafBits})];
    if (at < 0) return;
    float& there =
        field_.leaves[static_cast<std::size_t>(at)].value(BandLeaf::node(node[0], node[1], node[2]));
    there = std::min(there, value);
  }

  /// Roots are kept off nodes; where all faces around the node agree on the plane, their vertices stand on it all the same.
  bool may_slide(const Int3& node, const Float3& normal) const {
    for (const std::uint32_t edge : edges_of(node)) {
      auto c = std::lower_bound(crossings_.begin(), crossings_.end(), edge,
                                [](const SolidCrossing& l, std::uint32_t e) { return l.edge < e; });
      for (; c != crossings_.end() && c->edge == edge; ++c)
        if (std::fabs(dot(c->normal, normal)) < kSlideCosine) return false;
    }
    return true;
  }

  SolidBlock block_;
  std::vector<SolidCrossing> crossings_;
  std::span<const SolidOperand* const> operands_;
  const SolidTree& tree_;
  SolidFieldReport& report_;
  DirectedField field_;
  std::vector<std::size_t> slot_;  ///< per leaf
  std::vector<float> windings_;
  std::vector<SolidCrossing> own_;
  std::vector<BorderRegions> regions_;  ///< per operand
  std::vector<std::uint64_t> states_;
  std::vector<float> now_;
};

}  // namespace

bool SolidCrossing::operator<(const SolidCrossing& o) const {
  return std::tie(edge, t, operand, winding, normal) < std::tie(o.edge, o.t, o.operand, o.winding, o.normal);
}

Int3 SolidBlock::leaf(std::size_t slot) const {
  const Int3 d = dims();
  const auto s = static_cast<std::int64_t>(slot);
  return {static_cast<int>(s % d[0]) - 1, static_cast<int>(s / d[0] % d[1]) - 1,
          static_cast<int>(s / d[0] / d[1]) - 1};
}

SolidCrossing SolidBlock::local_crossing(const LatticeCrossing& crossing, const Float3& normal,
                                         std::uint8_t operand) const {
  const Int3 n = {crossing.node[0] - origin[0], crossing.node[1] - origin[1], crossing.node[2] - origin[2]};
  const std::size_t at = slot({n[0] >> kLeafBits, n[1] >> kLeafBits, n[2] >> kLeafBits});
  SolidCrossing c;
  c.edge =
      static_cast<std::uint32_t>((at * 3 + crossing.axis) * kLeafNodes + BandLeaf::node(n[0], n[1], n[2]));
  c.t = static_cast<float>(crossing.t);
  c.normal = normal;
  c.winding = crossing.winding;
  c.operand = operand;
  return c;
}

DirectedField build_solid_field(const SolidBlock& block, std::vector<SolidCrossing>&& crossings,
                                std::span<const SolidOperand* const> operands, const SolidTree& tree,
                                std::span<const Int3> closing, SolidFieldReport& report,
                                const std::function<void()>& pause) {
  return Builder(block, std::move(crossings), operands, tree, report).build(closing, pause);
}

std::uint64_t solid_field_bytes(std::uint64_t leaves, std::uint64_t crossings, std::uint64_t slots,
                                std::uint64_t operands) {
  return leaves * (sizeof(BandLeaf) + 2300 + 2048 * operands + 16) +
         crossings * (2 * sizeof(SolidCrossing) + 2 * sizeof(EdgeRoot)) + slots * 8 +
         operands * BorderRegions::kBytes;
}

}  // namespace tessera
