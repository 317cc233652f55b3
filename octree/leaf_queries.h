/// \file leaf_queries.h
/// What the fields over a MultipoleTree share: queries grouped by leaf and taken eight at a time, coordinates relative
/// to the leaf, and the step from the global tree down to the near one.
#pragma once
#include <immintrin.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <span>
#include <utility>

#include "octree/lanes.h"
#include "octree/lattice.h"
#include "octree/multipole.h"

namespace tessera {

using Pack = __m256;
[[nodiscard]] inline Pack all(float v) {
  return _mm256_set1_ps(v);
}

/// Level of the leaves that queries are grouped by. \param near  may be null
[[nodiscard]] inline int finest_bits(const MultipoleTree& far, const MultipoleTree* near) {
  return near ? near->leaf_bits() : far.leaf_bits();
}

/// Of a point relative to the corner of a leaf, in cells; exact.
[[nodiscard]] inline Float3 relative_to_leaf(const Int3& q, const Int3& leaf, int finest) {
  Float3 p;
  for (std::size_t a = 0; a < 3; ++a)
    p[a] = static_cast<float>(q[a] - leaf[a] * (kQuantaPerCell << finest)) * (1.0f / kQuantaPerCell);
  return p;
}

/// Children, in the near tree, of the cell of its top level with this key: begin and end on the level below.
/// \pre the near tree holds the cell
[[nodiscard]] inline std::pair<std::size_t, std::size_t> near_children(const MultipoleTree& near,
                                                                       std::uint64_t key) {
  const MultipoleTree::Level& top = near.level(near.top_bits());
  const auto root = std::lower_bound(top.cells.begin(), top.cells.end(), key,
                                     [](const Multipole& l, std::uint64_t k) { return l.key < k; });
  assert(root != top.cells.end() && root->key == key && "the near tree holds all adjacent cells");
  const auto index = static_cast<std::size_t>(root - top.cells.begin());
  return {top.first_child[index], top.first_child[index + 1]};
}

/// Calls begin_leaf(leaf) for every run of queries in one leaf, and then eight(at, count, x, y, z) for each eight of
/// them: index of the first, how many count (the last is repeated), coordinates relative to the leaf in cells.
template <class BeginLeaf, class Eight>
void for_each_eight(std::span<const Int3> queries, int finest, const BeginLeaf& begin_leaf,
                    const Eight& eight) {
  const int shift = kQuantumBits + finest;
  const auto leaf_of = [&](const Int3& q) { return Int3{q[0] >> shift, q[1] >> shift, q[2] >> shift}; };
  for (std::size_t begin = 0, end = 0; begin < queries.size(); begin = end) {
    const Int3 leaf = leaf_of(queries[begin]);
    for (end = begin + 1; end < queries.size() && leaf_of(queries[end]) == leaf;) ++end;
    begin_leaf(leaf);
    for (std::size_t at = begin; at < end; at += kLanes) {
      const std::size_t count = std::min(kLanes, end - at);
      alignas(32) std::array<std::array<float, kLanes>, 3> q;
      for (std::size_t i = 0; i < kLanes; ++i) {
        const Float3 p = relative_to_leaf(queries[at + std::min(i, count - 1)], leaf, finest);
        for (std::size_t a = 0; a < 3; ++a) q[a][i] = p[a];
      }
      eight(at, count, _mm256_load_ps(q[0].data()), _mm256_load_ps(q[1].data()), _mm256_load_ps(q[2].data()));
    }
  }
}

}  // namespace tessera
