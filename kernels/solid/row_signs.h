/// \file row_signs.h
/// Which nodes of the lattice lie inside a closed surface of the extractor: the signs of the leaves that lines along x
/// enter or leave it in, and what lines are beyond them. Exact for every node, however far from the surface.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/field/directed_field.h"
#include "kernels/solid/line_windings.h"

namespace tessera {

/// A leaf in which lines along x cross the surface, the edges to the next leaf included.
struct LeafSigns {
  std::uint64_t key = 0;    ///< leaf_row_key
  LeafWords inside{};       ///< per node
  std::uint64_t after = 0;  ///< per line y + 8 z: inside at the first node of the next leaf

  bool operator<(const LeafSigns& other) const { return key < other.key; }
};
static_assert(sizeof(LeafSigns) == 80);

/// Appends those of the leaves of the field's core. \pre its nodes there all have signs
void append_leaf_signs(const DirectedField& field, std::vector<LeafSigns>& out);

class RowSigns {
 public:
  /// \param leaves  of the whole surface, in any order, no repeats
  explicit RowSigns(std::vector<LeafSigns> leaves);
  /// Signs of the nodes of a leaf: set where inside. \param leaf  global, in leaves
  [[nodiscard]] LeafWords at(const Int3& leaf) const;
  [[nodiscard]] std::uint64_t bytes() const { return leaves_.capacity() * sizeof(LeafSigns); }

 private:
  std::vector<LeafSigns> leaves_;
};

/// Node by node, for one thread: it holds the leaf that was asked last.
class NodeSigns {
 public:
  explicit NodeSigns(const RowSigns& signs) : signs_(signs) {}
  bool inside(const Int3& node) {
    const Int3 leaf = {node[0] >> kLeafBits, node[1] >> kLeafBits, node[2] >> kLeafBits};
    if (leaf != leaf_) {
      words_ = signs_.at(leaf);
      leaf_ = leaf;
    }
    return (words_[static_cast<std::size_t>(DirectedField::word(node[2]))] >>
                DirectedField::bit(node[0], node[1]) &
            1) != 0;
  }

 private:
  const RowSigns& signs_;
  Int3 leaf_ = {-1, -1, -1};
  LeafWords words_{};
};

}  // namespace tessera
