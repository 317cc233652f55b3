#include "kernels/closing/sign_flow.h"

#include <algorithm>
#include <bit>

#include "octree/morton.h"

namespace tessera {
namespace {

/// Reach of the binomial kernel of eighth order, whose standard deviation is 1.4 cells.
constexpr int kBlurRadius = 4;
/// Distance from a plane at which the blur of its signs has a value, per value, near the plane: sqrt(pi / 2) deviations.
constexpr float kCellsPerBlur = 1.77f;
/// How far unknown nodes look for a sign, and how far from the closing cells signs may change: nodes.
constexpr int kFillHalo = 8, kFlowRadius = 4, kLooseRadius = 1;
/// Blurred sign from which a node changes to it: more than the lattice makes of a plane, so that none moves.
constexpr float kSure = 0.15f;
/// Distance of the winding number from its level from which it confirms a local sign.
constexpr float kCertainSign = 0.25f;

/// A value per node of a brick and a halo around it.
template <typename T>
class Block {
 public:
  Block(const Int3& brick, int halo, T fill)
      : halo_(halo),
        edge_(kBrickCells + 2 * halo),
        values_(std::size_t(edge_) * std::size_t(edge_) * std::size_t(edge_), fill) {
    for (std::size_t a = 0; a < 3; ++a) low_[a] = brick[a] * kBrickCells - halo;
  }
  int edge() const { return edge_; }
  int halo() const { return halo_; }
  std::ptrdiff_t step(std::size_t axis) const {
    const std::ptrdiff_t e = edge_;
    return axis == 0 ? 1 : axis == 1 ? e : e * e;
  }
  std::size_t slot(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * static_cast<std::size_t>(edge_) + static_cast<std::size_t>(j)) *
               static_cast<std::size_t>(edge_) +
           static_cast<std::size_t>(i);
  }
  /// Calls visit(slot, word, bit) for every node of a leaf that lies in the block.
  template <class Visit>
  void for_leaf(const Int3& origin, const Visit& visit) const {
    Int3 at;
    for (std::size_t a = 0; a < 3; ++a) at[a] = origin[a] - low_[a];
    for (int z = 0; z < kLeafCells; ++z)
      for (int y = 0; y < kLeafCells; ++y)
        for (int x = 0; x < kLeafCells; ++x) {
          const Int3 n = {at[0] + x, at[1] + y, at[2] + z};
          if (std::min({n[0], n[1], n[2]}) < 0 || std::max({n[0], n[1], n[2]}) >= edge_) continue;
          visit(slot(n[0], n[1], n[2]), static_cast<std::size_t>(z), std::uint64_t{1} << (x + 8 * y));
        }
  }
  std::vector<T>& values() { return values_; }
  T& operator[](std::size_t slot) { return values_[slot]; }

 private:
  int halo_, edge_;
  Int3 low_;
  std::vector<T> values_;
};

constexpr int kLeafCodeBits = 3 * (kBrickBits - kLeafBits);

std::uint64_t leaf_key(const Int3& origin) {
  return morton_encode(static_cast<std::uint32_t>(origin[0] >> kLeafBits),
                       static_cast<std::uint32_t>(origin[1] >> kLeafBits),
                       static_cast<std::uint32_t>(origin[2] >> kLeafBits));
}
Int3 leaf_origin(std::uint64_t key) {
  const auto at = morton_decode(key);
  return {static_cast<int>(at[0]) * kLeafCells, static_cast<int>(at[1]) * kLeafCells,
          static_cast<int>(at[2]) * kLeafCells};
}

/// Calls visit(key of the brick) for a brick and those around it.
template <class Visit>
void for_bricks_around(const Int3& brick, const Visit& visit) {
  for (int z = brick[2] - 1; z <= brick[2] + 1; ++z)
    for (int y = brick[1] - 1; y <= brick[1] + 1; ++y)
      for (int x = brick[0] - 1; x <= brick[0] + 1; ++x)
        if (std::min({x, y, z}) >= 0) visit(brick_key({x, y, z}));
}

std::pair<SignMap::const_iterator, SignMap::const_iterator> leaves_of(const SignMap& region,
                                                                      std::uint64_t brick) {
  return {region.lower_bound(brick << kLeafCodeBits), region.lower_bound((brick + 1) << kLeafCodeBits)};
}

/// -1 inside, 1 outside, 0 unknown; of leaves that the region lacks, 0 too.
template <typename T>
Block<T> signs_around(const SignMap& region, const Int3& brick, int halo) {
  Block<T> block(brick, halo, T{0});
  for_bricks_around(brick, [&](std::uint64_t key) {
    const auto [begin, end] = leaves_of(region, key);
    for (auto l = begin; l != end; ++l)
      block.for_leaf(leaf_origin(l->first), [&](std::size_t slot, std::size_t z, std::uint64_t bit) {
        if (l->second.known[z] & bit) block[slot] = l->second.inside[z] & bit ? T{-1} : T{1};
      });
  });
  return block;
}

/// Marks what lies first to last from marked places along each axis, both together a box; right beyond so much from the
/// faces.
void widen(Block<std::uint8_t>& marks, int first, int last) {
  std::vector<std::uint8_t> out;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<std::uint8_t>& in = marks.values();
    const std::ptrdiff_t step = marks.step(axis), size = static_cast<std::ptrdiff_t>(in.size());
    out.assign(in.size(), 0);
    // Rows wrap around at the faces of the block: that reaches nodes of the halo alone.
    for (std::ptrdiff_t d = first; d <= last; ++d) {
      const std::ptrdiff_t shift = d * step;
      for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, -shift); i < std::min(size, size - shift); ++i)
        out[static_cast<std::size_t>(i + shift)] |= in[static_cast<std::size_t>(i)];
    }
    marks.values().swap(out);
  }
}

/// Signs of unknown nodes of the region from their six neighbours, outwards.
void fill_unknown(const SignMap& region, const Int3& brick, Block<std::int8_t>& signs) {
  std::vector<std::size_t> unknown;
  for_bricks_around(brick, [&](std::uint64_t key) {
    const auto [begin, end] = leaves_of(region, key);
    for (auto l = begin; l != end; ++l)
      signs.for_leaf(leaf_origin(l->first), [&](std::size_t slot, std::size_t, std::uint64_t) {
        if (signs[slot] == 0) unknown.push_back(slot);
      });
  });
  const auto size = static_cast<std::ptrdiff_t>(signs.values().size());
  std::vector<std::int8_t> found(unknown.size());
  for (int sweep = 0; sweep < kFillHalo && !unknown.empty(); ++sweep) {
    for (std::size_t u = 0; u < unknown.size(); ++u) {
      int sum = 0;
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (const std::ptrdiff_t d : {-signs.step(axis), signs.step(axis)}) {
          const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(unknown[u]) + d;
          if (at >= 0 && at < size) sum += signs[static_cast<std::size_t>(at)];
        }
      found[u] = static_cast<std::int8_t>((sum > 0) - (sum < 0));
    }
    std::size_t left = 0;
    for (std::size_t u = 0; u < unknown.size(); ++u) {
      signs[unknown[u]] = found[u];
      if (found[u] == 0) unknown[left++] = unknown[u];
    }
    unknown.resize(left);
  }
}

/// Blurs with the binomial kernel along each axis; right beyond its reach from the faces. Signs are blurred exactly: all
/// sums are multiples of 2^-24.
void blur(Block<float>& block) {
  std::vector<float> out(block.values().size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<float>& in = block.values();
    const auto step = static_cast<std::size_t>(block.step(axis));
    const auto pair = [&](std::size_t i, std::size_t d) { return in[i - d * step] + in[i + d * step]; };
    for (std::size_t i = 4 * step; i < in.size() - 4 * step; ++i)
      out[i] = (70.0f * in[i] + 56.0f * pair(i, 1) + 28.0f * pair(i, 2) + 8.0f * pair(i, 3) + pair(i, 4)) *
               (1.0f / 256.0f);
    block.values().swap(out);
  }
}

}  // namespace

SignMap flow_region(const ClosingMap& cells) {
  SignMap region;
  for (const auto& [key, leaves] : cells)
    for (const ClosingLeaf& leaf : leaves)
      for (int d = 0; d < 27; ++d) {
        const Int3 at = {leaf.origin[0] + (d % 3 - 1) * kLeafCells,
                         leaf.origin[1] + (d / 3 % 3 - 1) * kLeafCells,
                         leaf.origin[2] + (d / 9 - 1) * kLeafCells};
        if (std::min({at[0], at[1], at[2]}) >= 0) region.try_emplace(leaf_key(at));
      }
  return region;
}

void add_field_signs(std::span<const BandSigns> signs, SignMap& map) {
  for (const BandSigns& s : signs) {
    NodeSigns& leaf = map[leaf_key(s.origin)];
    for (std::size_t z = 0; z < 8; ++z) {
      leaf.field[z] |= s.valid[z];
      leaf.known[z] |= s.valid[z];
      leaf.inside[z] |= s.valid[z] & s.inside[z];
      leaf.original[z] = leaf.inside[z];
    }
  }
}

void enter_local_signs(std::span<const BandSigns> signs, SignMap& region) {
  for (const BandSigns& s : signs) {
    const auto found = region.find(leaf_key(s.origin));
    if (found == region.end()) continue;
    found->second.local = found->second.known = s.valid;
    for (std::size_t z = 0; z < 8; ++z) found->second.inside[z] = s.inside[z] & s.valid[z];
  }
}

void enter_field_signs(const SignMap& signs, SignMap& region) {
  for (const auto& [key, from] : signs) {
    const auto found = region.find(key);
    if (found == region.end()) continue;
    NodeSigns& leaf = found->second;
    for (std::size_t z = 0; z < 8; ++z) {
      leaf.field[z] = from.field[z] & ~leaf.local[z];
      leaf.known[z] |= leaf.field[z];
      leaf.inside[z] |= leaf.field[z] & from.inside[z];
    }
  }
}

SignChange prepare_flow(const SignMap& region, const ClosingMap& cells, const Int3& brick) {
  Block<std::int8_t> signs = signs_around<std::int8_t>(region, brick, kFillHalo);
  fill_unknown(region, brick, signs);
  Block<std::uint8_t> around(brick, kFillHalo, 0);
  for_bricks_around(brick, [&](std::uint64_t key) {
    const auto found = cells.find(key);
    if (found == cells.end()) return;
    for (const ClosingLeaf& leaf : found->second)
      around.for_leaf(leaf.origin, [&](std::size_t slot, std::size_t z, std::uint64_t bit) {
        if (leaf.cells[z] & bit) around[slot] = 1;
      });
  });
  Block<std::uint8_t> loose = around;
  widen(around, -kFlowRadius, kFlowRadius + 1);
  widen(loose, -kLooseRadius, kLooseRadius + 1);
  const auto [begin, end] = leaves_of(region, brick_key(brick));
  SignChange out(begin, end);
  for (auto& entry : out) {
    NodeSigns& leaf = entry.second;
    signs.for_leaf(leaf_origin(entry.first), [&](std::size_t slot, std::size_t z, std::uint64_t bit) {
      if (!signs[slot]) return;
      leaf.known[z] |= bit;
      if (signs[slot] < 0) leaf.inside[z] |= bit;
      if (leaf.local[z] & bit ? loose[slot] : around[slot]) leaf.free[z] |= bit;
    });
    leaf.original = leaf.inside;
  }
  return out;
}

std::vector<Int3> loose_nodes(const SignChange& leaves) {
  std::vector<Int3> out;
  for (const auto& [key, leaf] : leaves)
    for (std::size_t z = 0; z < 8; ++z)
      for (std::uint64_t left = leaf.local[z] & leaf.free[z]; left; left &= left - 1) {
        const int b = std::countr_zero(left);
        const Int3 o = leaf_origin(key);
        out.push_back({(o[0] + (b & 7)) * kQuantaPerCell, (o[1] + (b >> 3)) * kQuantaPerCell,
                       (o[2] + static_cast<int>(z)) * kQuantaPerCell});
      }
  return out;
}

void fix_local(std::span<const float> winding, float level, SignChange& leaves) {
  std::size_t next = 0;
  for (auto& [key, leaf] : leaves)
    for (std::size_t z = 0; z < 8; ++z)
      for (std::uint64_t left = leaf.local[z] & leaf.free[z]; left; left &= left - 1) {
        const std::uint64_t bit = left & (~left + 1);
        const float above = winding[next++] - level;
        if ((leaf.inside[z] & bit ? above : -above) > kCertainSign) leaf.free[z] &= ~bit;
      }
}

SignChange flow_signs(const SignMap& region, const Int3& brick) {
  Block<float> block = signs_around<float>(region, brick, kBlurRadius);
  blur(block);
  const auto [begin, end] = leaves_of(region, brick_key(brick));
  SignChange out(begin, end);
  for (auto& entry : out) {
    NodeSigns& leaf = entry.second;
    block.for_leaf(leaf_origin(entry.first), [&](std::size_t slot, std::size_t z, std::uint64_t bit) {
      if (!(leaf.free[z] & bit)) return;
      if (block[slot] > kSure) leaf.inside[z] &= ~bit;
      if (block[slot] < -kSure) leaf.inside[z] |= bit;
    });
  }
  return out;
}

std::vector<FixedSigns> fixed_around(const SignMap& signs, const Int3& brick) {
  std::vector<FixedSigns> out;
  for (int d = 0; d < 8; ++d) {
    const auto [begin, end] =
        leaves_of(signs, brick_key({brick[0] + (d & 1), brick[1] + (d >> 1 & 1), brick[2] + (d >> 2)}));
    for (auto l = begin; l != end; ++l) {
      FixedSigns s;
      s.origin = leaf_origin(l->first);
      bool near = true;
      for (std::size_t a = 0; a < 3; ++a) near &= s.origin[a] <= (brick[a] + 1) * kBrickCells;
      if (!near) continue;
      for (std::size_t z = 0; z < 8; ++z) {
        s.forced[z] = l->second.forced(z);
        s.known[z] = l->second.field[z];
      }
      s.inside = l->second.inside;
      out.push_back(s);
    }
  }
  return out;
}

std::vector<Int3> forced_cells(const SignMap& signs) {
  std::vector<Int3> out;
  for (const auto& [key, leaf] : signs) {
    const Int3 origin = leaf_origin(key);
    for (std::size_t z = 0; z < 8; ++z)
      for (std::uint64_t left = leaf.forced(z); left; left &= left - 1) {
        const int b = std::countr_zero(left);
        for (int d = 0; d < 8; ++d) {
          const Int3 c = {origin[0] + (b & 7) - (d & 1), origin[1] + (b >> 3) - (d >> 1 & 1),
                          origin[2] + static_cast<int>(z) - (d >> 2)};
          if (std::min({c[0], c[1], c[2]}) >= 0) out.push_back(c);
        }
      }
  }
  return out;
}

std::vector<ClosingLeaf> flow_values(const SignMap& signs, const Int3& brick) {
  std::vector<ClosingLeaf> out;
  const auto [begin, end] = leaves_of(signs, brick_key(brick));
  if (begin == end) return out;
  Block<std::uint8_t> near(brick, kBlurRadius, 0);
  bool any = false;
  for_bricks_around(brick, [&](std::uint64_t key) {
    const auto [first, last] = leaves_of(signs, key);
    for (auto l = first; l != last; ++l) {
      std::uint64_t some = 0;
      for (std::size_t z = 0; z < 8; ++z) some |= l->second.forced(z);
      if (!some) continue;
      any = true;
      near.for_leaf(leaf_origin(l->first), [&](std::size_t slot, std::size_t z, std::uint64_t bit) {
        if (l->second.forced(z) & bit) near[slot] = 1;
      });
    }
  });
  if (!any) return out;
  widen(near, -1, 1);
  Block<float> block = signs_around<float>(signs, brick, kBlurRadius);
  blur(block);
  for (auto l = begin; l != end; ++l) {
    ClosingLeaf leaf{leaf_origin(l->first), {}, {}, {}, {}, {}};
    bool some = false;
    near.for_leaf(leaf.origin, [&](std::size_t slot, std::size_t z, std::uint64_t bit) {
      if (!near[slot]) return;
      some = true;
      leaf.near[z] |= bit;
      const float cells = std::clamp(block[slot] * kCellsPerBlur, -2.0f, 2.0f);
      leaf.value[64 * z + static_cast<std::size_t>(std::countr_zero(bit))] =
          static_cast<std::int8_t>(cells * kFlowSteps);
    });
    if (!some) continue;
    for (std::size_t z = 0; z < 8; ++z) {
      leaf.forced[z] = l->second.forced(z);
      leaf.inside[z] = leaf.forced[z] & l->second.inside[z];
    }
    out.push_back(leaf);
  }
  return out;
}

std::uint64_t add_flow_values(std::vector<ClosingLeaf> values, std::vector<ClosingLeaf>& cells) {
  std::uint64_t count = 0;
  for (ClosingLeaf& leaf : values) {
    for (const std::uint64_t w : leaf.forced) count += static_cast<std::uint64_t>(std::popcount(w));
    const std::uint64_t key = leaf_key(leaf.origin);
    const auto at =
        std::lower_bound(cells.begin(), cells.end(), key,
                         [](const ClosingLeaf& l, std::uint64_t k) { return leaf_key(l.origin) < k; });
    if (at == cells.end() || leaf_key(at->origin) != key) {
      cells.insert(at, leaf);
    } else {
      leaf.cells = at->cells;
      *at = leaf;
    }
  }
  return count;
}

}  // namespace tessera
