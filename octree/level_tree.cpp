#include "octree/level_tree.h"

#include <algorithm>
#include <cassert>

namespace tessera {
namespace {

constexpr int kBrickAxisBits = kMaxCellBits - kBrickBits;

void make_set(std::vector<std::uint64_t>& keys) {
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
}

bool on_lattice(const Int3& node, int level) {
  for (const int c : node)
    if (c < 0 || c >= 1 << (kBrickAxisBits - level)) return false;
  return true;
}

Int3 neighbour(const Int3& node, int d) {
  return {node[0] + d % 3 - 1, node[1] + d / 3 % 3 - 1, node[2] + d / 9 - 1};
}

}  // namespace

LevelTree::LevelTree(int levels, std::vector<std::vector<std::uint64_t>> split) : split_(std::move(split)) {
  assert(levels >= 1 && levels <= kMaxLevels && split_.size() <= static_cast<std::size_t>(levels));
  split_.resize(static_cast<std::size_t>(levels));
  // The children of a split node have leaves of its level or finer ones around them: the parents of the 26 nodes around
  // it are split, its own among them.
  for (std::size_t level = 1; level < split_.size(); ++level) {
    make_set(split_[level]);
    if (level + 1 == split_.size()) break;
    std::size_t compact_at = std::size_t{1} << 16;
    auto& above = split_[level + 1];
    for (const std::uint64_t key : split_[level]) {
      const Int3 node = brick_of_key(key);
      for (int d = 0; d < 27; ++d) {
        const Int3 n = neighbour(node, d);
        if (on_lattice(n, static_cast<int>(level))) above.push_back(brick_key(n) >> 3);
      }
      if (above.size() > compact_at) {
        make_set(above);
        compact_at = 2 * above.size() + (std::size_t{1} << 16);
      }
    }
  }
}

bool LevelTree::is_split(const Int3& node, int level) const {
  const auto& keys = split_[static_cast<std::size_t>(level)];
  return std::binary_search(keys.begin(), keys.end(), brick_key(node));
}

int LevelTree::level_of(const Int3& brick) const {
  for (int level = levels() - 1; level > 0; --level)
    if (!is_split({brick[0] >> level, brick[1] >> level, brick[2] >> level}, level)) return level;
  return 0;
}

std::array<int, 27> LevelTree::steps_around(const Int3& leaf, int level) const {
  std::array<int, 27> steps{};
  for (int d = 0; d < 27; ++d) {
    const Int3 n = neighbour(leaf, d);
    if (d == 13 || !on_lattice(n, level)) continue;
    auto& step = steps[static_cast<std::size_t>(d)];
    if (level > 0 && is_split(n, level))
      step = -1;
    else if (level + 1 < levels() && !is_split({n[0] >> 1, n[1] >> 1, n[2] >> 1}, level + 1))
      step = 1;
  }
  return steps;
}

}  // namespace tessera
