#include "kernels/field/point_leaves.h"

#include <cassert>
#include <cmath>

namespace tessera {
namespace {

int floor_to_int(float v) {
  return static_cast<int>(std::floor(v));
}

}  // namespace

PointLeaves index_leaves(const PointBlock& points, bool mark) {
  PointLeaves leaves;
  leaves.dims = {points.cells[0] / kLeafCells + 2, points.cells[1] / kLeafCells + 2,
                 points.cells[2] / kLeafCells + 2};
  const auto count = static_cast<std::size_t>(leaves.dims[0]) * static_cast<std::size_t>(leaves.dims[1]) *
                     static_cast<std::size_t>(leaves.dims[2]);
  leaves.range.resize(count);
  if (mark) leaves.mark_index.assign(count, -1);
  std::size_t open = count;  // leaf whose range grows
  const std::size_t n = points.size();
  for (std::size_t p = 0; p < n; ++p) {
    const float x = points.x[p], y = points.y[p], z = points.z[p];
    const int i = floor_to_int(x) >> kLeafBits, j = floor_to_int(y) >> kLeafBits,
              k = floor_to_int(z) >> kLeafBits;
    if (!leaves.holds(i, j, k)) {
      open = count;
      continue;
    }
    const std::size_t leaf = leaves.at(i, j, k);
    if (leaf != open) {
      assert(leaves.range[leaf].end == 0 && "points must be in canonical order");
      leaves.range[leaf].begin = static_cast<std::uint32_t>(p);
      open = leaf;
    }
    leaves.range[leaf].end = static_cast<std::uint32_t>(p + 1);
    if (!mark) continue;
    if (points.nx[p] == 0.0f && points.ny[p] == 0.0f && points.nz[p] == 0.0f) continue;
    const int a = floor_to_int(x + 0.5f), b = floor_to_int(y + 0.5f), c = floor_to_int(z + 0.5f);
    if (!leaves.holds(a >> kLeafBits, b >> kLeafBits, c >> kLeafBits)) continue;
    std::int32_t& index = leaves.mark_index[leaves.at(a >> kLeafBits, b >> kLeafBits, c >> kLeafBits)];
    if (index < 0) {
      index = static_cast<std::int32_t>(leaves.marks.size());
      leaves.marks.emplace_back();
    }
    leaves.marks[static_cast<std::size_t>(index)][static_cast<std::size_t>(c & 7)] |=
        std::uint64_t{1} << ((a & 7) + 8 * (b & 7));
  }
  for (std::size_t leaf = 0; mark && leaf < count; ++leaf)
    if (leaves.mark_index[leaf] >= 0) leaves.occupied.push_back(static_cast<std::uint32_t>(leaf));
  return leaves;
}

}  // namespace tessera
