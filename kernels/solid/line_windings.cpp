#include "kernels/solid/line_windings.h"

#include <algorithm>

namespace tessera {

void LeafWindings::add(const LeafWindings& other) {
  for (std::size_t line = 0; line < winding.size(); ++line)
    winding[line] = static_cast<std::int16_t>(winding[line] + other.winding[line]);
  crossings += other.crossings;
}

LineWindings::LineWindings(std::vector<LeafWindings> leaves) : leaves_(std::move(leaves)) {
  for (std::size_t i = 1; i < leaves_.size(); ++i) {
    if (leaves_[i].key >> 20 != leaves_[i - 1].key >> 20) continue;
    const std::uint32_t crossings = leaves_[i].crossings;
    leaves_[i].add(leaves_[i - 1]);
    leaves_[i].crossings = crossings;
  }
}

std::array<std::int16_t, 64> LineWindings::before(const Int3& leaf) const {
  if (leaf[0] < 0 || leaf[1] < 0 || leaf[2] < 0) return {};
  const std::uint64_t key = leaf_row_key(leaf);
  const auto at = std::lower_bound(leaves_.begin(), leaves_.end(), key,
                                   [](const LeafWindings& l, std::uint64_t k) { return l.key < k; });
  if (at == leaves_.begin() || (at - 1)->key >> 20 != key >> 20) return {};
  return (at - 1)->winding;
}

bool LineWindings::closes() const {
  for (std::size_t i = 0; i < leaves_.size(); ++i) {
    if (i + 1 < leaves_.size() && leaves_[i + 1].key >> 20 == leaves_[i].key >> 20) continue;
    for (const std::int16_t t : leaves_[i].winding)
      if (t != 0) return false;
  }
  return true;
}

}  // namespace tessera
