#include "kernels/solid/border_region.h"

#include <array>

#include "octree/lattice.h"

namespace tessera {
namespace {

constexpr int kCells = BorderRegion::kLeaves * kLeafCells;
constexpr int kScale = (kCells - 1) / (kLeafCells - 1);
static_assert(kScale * (kLeafCells - 1) == kCells - 1);
constexpr float kNearRadius = 32.0f;  ///< cells; leaves go on from clusters that are no wider

}  // namespace

BorderRegion::BorderRegion(const BorderWinding& border, const Int3& corner)
    : far_(corner, kScale), change_(border.change(far_.middle(), 0.5 * 1.7321 * (kCells - 1))) {
  if (border.empty()) return;
  std::array<std::uint32_t, BorderWinding::kStack> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::uint32_t number = stack[--top];
    const BorderCluster& c = border.clusters()[number];
    if (far_.is_far(c)) {
      far_.add_cluster(c);
    } else if (c.left != 0 && c.radius > kNearRadius) {
      stack[top++] = c.left + 1;
      stack[top++] = c.left;
    } else {
      near_.push_back(number);
    }
  }
}

const BorderRegion& BorderRegions::of(const BorderWinding& border, const Int3& leaf) {
  Int3 at;
  for (std::size_t a = 0; a < 3; ++a) at[a] = leaf[a] >> 3;
  const auto found = regions_.find(at);
  if (found != regions_.end()) return found->second;
  if (regions_.size() == kMax) regions_.clear();
  return regions_.try_emplace(at, border, Int3{at[0] * kCells, at[1] * kCells, at[2] * kCells}).first->second;
}

}  // namespace tessera
