#include "kernels/field/sparse_nodes.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr int kWindow = 3;  ///< coarse cells to either side of a node: what a leaf of halo holds
/// Occupied cells for every coarse one: lines have 2, the rims of holes amid dense samples 2.6 and more.
constexpr float kSparseRatio = 2.4f;
constexpr float kDepthOfRatio = 6.0f;                   ///< fine cells: places end within a ratio of 0.3
constexpr int kNodeRow = kLeafCells + 2 * kWindow - 1;  ///< cells that the nodes of a leaf see, along an axis
constexpr std::uint32_t kMinHalf = 6;  ///< coarse cells in half of what is around, else it does not tell

/// Occupied fine cells of every coarse cell around a block, from its leaf -2 to the second beyond.
struct Occupied {
  Int3 origin{}, dims{};  ///< in coarse cells
  std::vector<std::uint8_t> fine;
  std::vector<std::uint8_t> near;  ///< per leaf of the block, from -1 on: whether its nodes see any

  std::size_t at(const Int3& cell) const {
    return static_cast<std::size_t>((cell[2] * dims[1] + cell[1]) * dims[0] + cell[0]);
  }
};

/// Occupied cells in cubes of kWindow^3, one cube behind and one before every plane through a node of a leaf.
using Wide = std::array<std::uint16_t, static_cast<std::size_t>(kNodeRow) * kNodeRow * kNodeRow>;

std::size_t at_wide(int x, int y, int z) {
  return static_cast<std::size_t>((z * kNodeRow + y) * kNodeRow + x);
}

/// Turns counts into sums over kWindow entries along each axis, from an entry on.
void sum_cubes(Wide& box) {
  constexpr std::array<std::size_t, 3> kAxisStep = {1, kNodeRow, std::size_t{kNodeRow} * kNodeRow};
  for (const std::size_t step : kAxisStep)
    for (std::size_t i = 0; i + (kWindow - 1) * step < box.size(); ++i) {
      std::uint32_t sum = 0;
      for (std::size_t k = 0; k < kWindow; ++k) sum += box[i + k * step];
      box[i] = static_cast<std::uint16_t>(sum);  // what wraps around a row is not looked at
    }
}

/// Depths of the nodes of a leaf. \param low  first coarse cell that they see, in the grid \return whether any is within a place
bool find_depths(const Occupied& cells, const Int3& low, std::array<float, 512>& depth) {
  Wide fine, coarse;
  for (int z = 0; z < kNodeRow; ++z)
    for (int y = 0; y < kNodeRow; ++y) {
      const std::uint8_t* row = cells.fine.data() + cells.at({low[0], low[1] + y, low[2] + z});
      for (int x = 0; x < kNodeRow; ++x) {
        fine[at_wide(x, y, z)] = row[x];
        coarse[at_wide(x, y, z)] = row[x] > 0;
      }
    }
  sum_cubes(fine);
  sum_cubes(coarse);
  bool any = false;
  for (int n = 0; n < 512; ++n) {
    // Halves of what lies around: below and above along each axis.
    std::array<std::array<std::uint32_t, 2>, 3> f{}, c{};
    for (int cube = 0; cube < 8; ++cube) {
      const std::size_t i = at_wide((n & 7) + kWindow * (cube & 1), (n >> 3 & 7) + kWindow * (cube >> 1 & 1),
                                    (n >> 6) + kWindow * (cube >> 2));
      for (std::size_t a = 0; a < 3; ++a) {
        f[a][static_cast<std::size_t>(cube >> a & 1)] += fine[i];
        c[a][static_cast<std::size_t>(cube >> a & 1)] += coarse[i];
      }
    }
    float& out = depth[static_cast<std::size_t>(n)] = SparseNodes::kNowhere;
    const auto look = [&](std::uint32_t few, std::uint32_t of, std::uint32_t minimum) {
      if (of < minimum) return;
      const float ratio = static_cast<float>(few) / static_cast<float>(of);
      out = std::max(out, std::min(kDepthOfRatio * (kSparseRatio - ratio), SparseNodes::kDeep));
    };
    look(f[0][0] + f[0][1], c[0][0] + c[0][1], 1);
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t side = 0; side < 2; ++side) look(f[a][side], c[a][side], kMinHalf);
    any = any || out > SparseNodes::kNowhere;
  }
  return any;
}

/// Counts the points of a fine block. \param origin, dims  of the coarse block: corner, and leaves from -1 to one beyond
Occupied count_cells(const PointBlock& points, const Int3& origin, const Int3& dims) {
  Occupied out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.origin[a] = origin[a] - 2 * kLeafCells;
    out.dims[a] = kLeafCells * (dims[a] + 2);
  }
  out.fine.assign(static_cast<std::size_t>(out.dims[0] * out.dims[1] * out.dims[2]), 0);
  out.near.assign(static_cast<std::size_t>(dims[0] * dims[1] * dims[2]), 0);
  Int3 last{};
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (points.nx[p] == 0.0f && points.ny[p] == 0.0f && points.nz[p] == 0.0f) continue;
    const Int3 cell = {static_cast<int>(std::floor(points.x[p])) + points.origin[0],
                       static_cast<int>(std::floor(points.y[p])) + points.origin[1],
                       static_cast<int>(std::floor(points.z[p])) + points.origin[2]};
    if (p > 0 && cell == last) continue;  // canonical order visits a cell once
    last = cell;
    Int3 at, first, end;
    bool holds = true;
    for (std::size_t a = 0; a < 3; ++a) {
      at[a] = (cell[a] >> 1) - out.origin[a];
      holds = holds && at[a] >= 0 && at[a] < out.dims[a];
      // Leaves of the block whose nodes see it, from -1 on.
      first[a] = std::max(0, ((at[a] - kWindow + 1) >> kLeafBits) - 1);
      end[a] = std::min(dims[a] - 1, ((at[a] + kWindow) >> kLeafBits) - 1);
    }
    if (!holds) continue;
    std::uint8_t& count = out.fine[out.at(at)];
    if (count++ > 0) continue;
    for (int z = first[2]; z <= end[2]; ++z)
      for (int y = first[1]; y <= end[1]; ++y)
        for (int x = first[0]; x <= end[0]; ++x)
          out.near[static_cast<std::size_t>((z * dims[1] + y) * dims[0] + x)] = 1;
  }
  return out;
}

}  // namespace

SparseNodes::SparseNodes(const PointBlock& points, const std::function<bool(const Int3&)>& requested) {
  Int3 dims;
  for (std::size_t a = 0; a < 3; ++a) {
    const int low = (points.origin[a] - 1) >> 1, high = (points.origin[a] + points.cells[a] + 2) >> 1;
    origin_[a] = low & -kLeafCells;
    cells_[a] = (high - origin_[a] + kLeafCells - 1) & -kLeafCells;
    dims[a] = cells_[a] / kLeafCells + 2;
  }
  leaf_index_.assign(static_cast<std::size_t>(dims[0] * dims[1] * dims[2]), -1);
  const Occupied cells = count_cells(points, origin_, dims);
  std::size_t slot = 0;
  for (int k = -1; k < dims[2] - 1; ++k)
    for (int j = -1; j < dims[1] - 1; ++j)
      for (int i = -1; i < dims[0] - 1; ++i, ++slot) {
        if (!cells.near[slot] || (requested && !requested({i, j, k}))) continue;
        constexpr int kMargin = 2 * kLeafCells - kWindow;
        std::array<float, 512> depth;
        if (!find_depths(cells, {8 * i + kMargin, 8 * j + kMargin, 8 * k + kMargin}, depth)) continue;
        leaf_index_[slot] = static_cast<std::int32_t>(depth_.size());
        depth_.push_back(depth);
      }
}

}  // namespace tessera
