#include "kernels/field/field_parts.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <iterator>
#include <utility>

namespace tessera {
namespace {

std::uint32_t count_leaf_roots(const BandLeaf& leaf) {
  int count = 0;
  for (const LeafWords& axis : leaf.crossing)
    for (const std::uint64_t word : axis) count += std::popcount(word);
  return static_cast<std::uint32_t>(count);
}

void renumber_roots(BandLeaf& leaf, std::uint32_t from, std::uint32_t to) {
  for (auto& axis : leaf.first_root)
    for (std::uint32_t& first : axis) first = first - from + to;
}

}  // namespace

FieldParts::FieldParts(const Int3& origin, const Int3& cells) {
  block_.origin = origin;
  block_.cells = cells;
  const Int3 dims = block_.leaf_dims();
  block_.leaf_index.assign(static_cast<std::size_t>(dims[0]) * static_cast<std::size_t>(dims[1]) *
                               static_cast<std::size_t>(dims[2]),
                           -1);
}

void FieldParts::add(DirectedField&& part) {
  DirectedField field = std::move(part);
  Int3 offset;
  for (std::size_t a = 0; a < 3; ++a) {
    offset[a] = field.origin[a] - block_.origin[a];
    assert(offset[a] >= 0 && offset[a] % kLeafCells == 0 && field.cells[a] % kLeafCells == 0 &&
           offset[a] + field.cells[a] <= block_.cells[a]);
  }
  const Int3 dims = block_.leaf_dims();
  std::size_t move = 0;
  for (BandLeaf& leaf : field.leaves) {
    const std::uint32_t first = leaf.first_root[0][0], end = first + count_leaf_roots(leaf);
    const std::size_t first_move = move;
    while (move < field.moves.size() && field.moves[move].root < end) ++move;
    // Beyond the part another one knows the leaf whole, but not beyond the block.
    bool own = true;
    Int3 at;
    for (std::size_t a = 0; a < 3; ++a) {
      const bool low = leaf.origin[a] < 0, high = leaf.origin[a] >= field.cells[a];
      own = own && (!low || offset[a] == 0) && (!high || offset[a] + field.cells[a] == block_.cells[a]);
      leaf.origin[a] += offset[a];
      at[a] = leaf.origin[a] / kLeafCells + 1;
    }
    if (!own) continue;
    Piece piece{.at = (static_cast<std::size_t>(at[2]) * static_cast<std::size_t>(dims[1]) +
                       static_cast<std::size_t>(at[1])) *
                          static_cast<std::size_t>(dims[0]) +
                      static_cast<std::size_t>(at[0]),
                .leaf = std::move(leaf)};
    piece.first_root = static_cast<std::uint32_t>(roots_.size());
    piece.first_move = moves_.size();
    const auto range = [&](const auto& all) { return std::pair(all.begin() + first, all.begin() + end); };
    const auto [root, last_root] = range(field.roots);
    roots_.insert(roots_.end(), root, last_root);
    if (!field.creased.empty()) {
      const auto [flag, last_flag] = range(field.creased);
      creased_.insert(creased_.end(), flag, last_flag);
    }
    for (std::size_t m = first_move; m < move; ++m)
      moves_.push_back({field.moves[m].root - first + piece.first_root, field.moves[m].by});
    piece.end_root = static_cast<std::uint32_t>(roots_.size());
    piece.end_move = moves_.size();
    renumber_roots(piece.leaf, first, piece.first_root);
    pieces_.push_back(std::move(piece));
  }
}

DirectedField FieldParts::take() && {
  std::sort(pieces_.begin(), pieces_.end(), [](const Piece& a, const Piece& b) { return a.at < b.at; });
  block_.leaves.reserve(pieces_.size());
  block_.roots.reserve(roots_.size());
  block_.creased.reserve(creased_.size());
  block_.moves.reserve(moves_.size());
  for (Piece& piece : pieces_) {
    const auto root = static_cast<std::uint32_t>(block_.roots.size());
    const auto run = [&](const auto& from, auto& to) {
      to.insert(to.end(), from.begin() + piece.first_root, from.begin() + piece.end_root);
    };
    run(roots_, block_.roots);
    if (!creased_.empty()) run(creased_, block_.creased);
    for (std::size_t m = piece.first_move; m < piece.end_move; ++m)
      block_.moves.push_back({moves_[m].root - piece.first_root + root, moves_[m].by});
    renumber_roots(piece.leaf, piece.first_root, root);
    block_.leaf_index[piece.at] = static_cast<std::int32_t>(block_.leaves.size());
    block_.leaves.push_back(std::move(piece.leaf));
  }
  return std::move(block_);
}

}  // namespace tessera
