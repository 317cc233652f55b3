#include "kernels/field/sparse_places.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr int kWindow = 3;  ///< coarse cells to either side of a node: what a leaf of halo holds
/// Occupied cells for every coarse one: lines have 2, the rims of holes amid dense samples 2.6 and more.
constexpr float kSparseRatio = 2.4f;
constexpr float kDepthOfRatio = 6.0f;                ///< fine cells: places end within a ratio of 0.3
constexpr int kWide = kLeafCells + 2 * kWindow - 1;  ///< cells that the nodes of a leaf see, along an axis

/// Occupied fine cells of every coarse cell around a block, from its leaf -2 to the second beyond.
struct Occupied {
  Int3 origin{}, dims{};  ///< in coarse cells
  std::vector<std::uint8_t> fine;
  std::vector<std::uint8_t> near;  ///< per leaf of the block, from -1 on: whether its nodes see any

  std::size_t at(const Int3& cell) const {
    return static_cast<std::size_t>((cell[2] * dims[1] + cell[1]) * dims[0] + cell[0]);
  }
};

/// What every node of a leaf sees: occupied fine and coarse cells.
struct Seen {
  std::array<std::uint16_t, 512> fine, coarse;
};

using Wide = std::array<std::uint16_t, static_cast<std::size_t>(kWide) * kWide * kWide>;

/// Sums over six entries along an axis of a box, of which `size` are used; lines lie `step` apart, entries `along`.
void sum_axis(std::uint16_t* values, std::size_t along, std::size_t lines_a, std::size_t step_a,
              std::size_t lines_b, std::size_t step_b) {
  for (std::size_t b = 0; b < lines_b; ++b)
    for (std::size_t i = 0; i < kLeafCells; ++i) {
      std::uint16_t* to = values + b * step_b + i * along;
      for (std::size_t a = 0; a < lines_a; ++a) {
        std::uint16_t* v = to + a * step_a;
        std::uint32_t sum = 0;
        for (std::size_t k = 0; k < 2 * kWindow; ++k) sum += v[k * along];
        *v = static_cast<std::uint16_t>(sum);
      }
    }
}

void sum_box(Wide& box, std::array<std::uint16_t, 512>& out) {
  constexpr std::size_t kRow = kWide, kPlane = kRow * kRow;
  sum_axis(box.data(), kPlane, kRow, 1, kRow, kRow);
  sum_axis(box.data(), kRow, kRow, 1, kLeafCells, kPlane);
  sum_axis(box.data(), 1, kLeafCells, kRow, kLeafCells, kPlane);
  for (std::size_t z = 0; z < 8; ++z)
    for (std::size_t y = 0; y < 8; ++y)
      for (std::size_t x = 0; x < 8; ++x) out[x + 8 * y + 64 * z] = box[x + kRow * y + kPlane * z];
}

/// \param low  first coarse cell that the leaf's nodes see, in the grid
void look_around(const Occupied& cells, const Int3& low, Seen& seen) {
  Wide fine, coarse;
  for (int z = 0; z < kWide; ++z)
    for (int y = 0; y < kWide; ++y) {
      const std::uint8_t* row = cells.fine.data() + cells.at({low[0], low[1] + y, low[2] + z});
      const auto to = static_cast<std::size_t>((z * kWide + y) * kWide);
      for (std::size_t x = 0; x < kWide; ++x) {
        fine[to + x] = row[x];
        coarse[to + x] = row[x] > 0;
      }
    }
  sum_box(fine, seen.fine);
  sum_box(coarse, seen.coarse);
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

SparsePlaces::SparsePlaces(const PointBlock& points, const std::function<bool(const Int3&)>& asked) {
  Int3 dims;
  for (std::size_t a = 0; a < 3; ++a) {
    const int low = (points.origin[a] - 1) >> 1, high = (points.origin[a] + points.cells[a] + 2) >> 1;
    origin_[a] = low & -kLeafCells;
    cells_[a] = (high - origin_[a] + kLeafCells - 1) & -kLeafCells;
    dims[a] = cells_[a] / kLeafCells + 2;
  }
  leaf_index_.assign(static_cast<std::size_t>(dims[0] * dims[1] * dims[2]), -1);
  const Occupied cells = count_cells(points, origin_, dims);
  Seen seen;
  std::size_t slot = 0;
  for (int k = -1; k < dims[2] - 1; ++k)
    for (int j = -1; j < dims[1] - 1; ++j)
      for (int i = -1; i < dims[0] - 1; ++i, ++slot) {
        if (!cells.near[slot] || (asked && !asked({i, j, k}))) continue;
        constexpr int kMargin = 2 * kLeafCells - kWindow;
        look_around(cells, {8 * i + kMargin, 8 * j + kMargin, 8 * k + kMargin}, seen);
        std::array<float, 512> depth;
        bool any = false;
        for (std::size_t n = 0; n < 512; ++n) {
          depth[n] = kNowhere;
          if (seen.coarse[n] == 0) continue;
          const float ratio = static_cast<float>(seen.fine[n]) / static_cast<float>(seen.coarse[n]);
          depth[n] = std::clamp(kDepthOfRatio * (kSparseRatio - ratio), kNowhere, kDeep);
          any = any || depth[n] > kNowhere;
        }
        if (!any) continue;
        leaf_index_[slot] = static_cast<std::int32_t>(depth_.size());
        depth_.push_back(depth);
      }
}

}  // namespace tessera
