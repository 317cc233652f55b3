#include "kernels/solid/row_signs.h"

#include <algorithm>

namespace tessera {

void append_leaf_signs(const DirectedField& field, std::vector<LeafSigns>& out) {
  for (const BandLeaf& leaf : field.leaves) {
    bool core = true;
    for (std::size_t a = 0; a < 3; ++a) core = core && leaf.origin[a] >= 0 && leaf.origin[a] < field.cells[a];
    const LeafWords& crossing = leaf.crossing[0];
    if (!core || std::all_of(crossing.begin(), crossing.end(), [](std::uint64_t w) { return w == 0; }))
      continue;
    LeafSigns& made = out.emplace_back();
    made.key = leaf_row_key({(field.origin[0] + leaf.origin[0]) >> kLeafBits,
                             (field.origin[1] + leaf.origin[1]) >> kLeafBits,
                             (field.origin[2] + leaf.origin[2]) >> kLeafBits});
    made.inside = leaf.inside;
    for (std::size_t z = 0; z < 8; ++z)
      for (std::size_t y = 0; y < 8; ++y)
        made.after |= ((leaf.inside[z] ^ crossing[z]) >> (8 * y + 7) & 1) << (y + 8 * z);
  }
}

RowSigns::RowSigns(std::vector<LeafSigns> leaves) : leaves_(std::move(leaves)) {
  std::sort(leaves_.begin(), leaves_.end());
}

LeafWords RowSigns::at(const Int3& leaf) const {
  LeafWords words{};
  if (leaf[0] < 0 || leaf[1] < 0 || leaf[2] < 0) return words;
  const std::uint64_t key = leaf_row_key(leaf);
  const auto next = std::upper_bound(leaves_.begin(), leaves_.end(), key,
                                     [](std::uint64_t k, const LeafSigns& l) { return k < l.key; });
  if (next == leaves_.begin()) return words;
  const LeafSigns& last = *(next - 1);
  if (last.key == key) return last.inside;
  if (last.key >> 20 != key >> 20) return words;
  for (std::size_t z = 0; z < 8; ++z)
    for (std::size_t y = 0; y < 8; ++y)
      if (last.after >> (y + 8 * z) & 1) words[z] |= std::uint64_t{0xff} << (8 * y);
  return words;
}

}  // namespace tessera
