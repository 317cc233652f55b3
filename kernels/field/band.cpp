#include "kernels/field/band.h"

namespace tessera {
namespace {

constexpr int kBandRadius = 2 * kBandClosing + kBandLayers;  // nodes
constexpr int kWide = kLeafCells + 2 * kBandRadius;          // rows gathered around a leaf
static_assert(kBandRadius <= kLeafCells && kWide <= 32);

/// Bits of nodes -kBandRadius .. 7 + kBandRadius around one leaf: bit x + kBandRadius of row [z + kBandRadius][y + kBandRadius].
using Box = std::array<std::array<std::uint32_t, kWide>, kWide>;

/// Shrinks or grows along every axis; rows outside the box count as empty for growing, and the caller never
/// uses what shrinking makes of the outermost rows.
template <bool kGrow>
void morph(Box& box, int by) {
  const auto join = [](std::uint32_t a, std::uint32_t b) { return kGrow ? (a | b) : (a & b); };
  Box next{};
  for (std::size_t z = 0; z < kWide; ++z)
    for (std::size_t y = 0; y < kWide; ++y) {
      std::uint32_t row = box[z][y];
      for (int s = 1; s <= by; ++s) row = join(row, join(box[z][y] << s, box[z][y] >> s));
      next[z][y] = row;
    }
  box = next;
  const auto last = static_cast<std::size_t>(kWide - by);
  const auto step = static_cast<std::size_t>(by);
  for (std::size_t z = 0; z < kWide; ++z)
    for (std::size_t y = step; y < last; ++y)
      for (std::size_t s = 1; s <= step; ++s)
        next[z][y] = join(next[z][y], join(box[z][y - s], box[z][y + s]));
  box = next;
  for (std::size_t z = step; z < last; ++z)
    for (std::size_t s = 1; s <= step; ++s)
      for (std::size_t y = 0; y < kWide; ++y)
        next[z][y] = join(next[z][y], join(box[z - s][y], box[z + s][y]));
  box = next;
}

/// Copies the marks of one neighbour leaf at offset (di, dj, dk) into the box.
void paste(const std::array<std::uint64_t, 8>& words, int di, int dj, int dk, Box& box) {
  for (int z = 0; z < kLeafCells; ++z) {
    const int row_z = z + kLeafCells * dk + kBandRadius;
    if (row_z < 0 || row_z >= kWide || !words[static_cast<std::size_t>(z)]) continue;
    for (int y = 0; y < kLeafCells; ++y) {
      const int row_y = y + kLeafCells * dj + kBandRadius;
      if (row_y < 0 || row_y >= kWide) continue;
      const std::uint64_t bits = words[static_cast<std::size_t>(z)] >> (8 * y) & 0xff;
      const int shift = kLeafCells * di + kBandRadius;
      box[static_cast<std::size_t>(row_z)][static_cast<std::size_t>(row_y)] |=
          static_cast<std::uint32_t>(shift >= 0 ? bits << shift : bits >> -shift) & ((1u << kWide) - 1u);
    }
  }
}

}  // namespace

std::array<std::uint64_t, 8> nodes_in_block(const Int3& leaf, const Int3& cells) {
  const auto axis_bits = [&](std::size_t axis) {
    std::uint32_t bits = 0;
    for (int v = 0; v < kLeafCells; ++v) {
      const int node = leaf[axis] * kLeafCells + v;
      if (node >= -1 && node <= cells[axis] + 1) bits |= 1u << v;
    }
    return bits;
  };
  const std::uint32_t x = axis_bits(0), y = axis_bits(1), z = axis_bits(2);
  std::uint64_t plane = 0;
  for (int v = 0; v < kLeafCells; ++v)
    if (y >> v & 1) plane |= static_cast<std::uint64_t>(x) << (8 * v);
  std::array<std::uint64_t, 8> words{};
  for (std::size_t v = 0; v < words.size(); ++v)
    if (z >> v & 1) words[v] = plane;
  return words;
}

std::vector<BandNodes> choose_band(const PointLeaves& leaves, const NodeFilter& wanted) {
  // Only leaves beside a marked one can hold band nodes.
  std::vector<std::uint8_t> near(leaves.range.size(), 0);
  for (const std::uint32_t leaf : leaves.occupied) {
    const auto index = static_cast<int>(leaf);
    const int i = index % leaves.dims[0] - 1, j = index / leaves.dims[0] % leaves.dims[1] - 1,
              k = index / (leaves.dims[0] * leaves.dims[1]) - 1;
    for (int dk = -1; dk <= 1; ++dk)
      for (int dj = -1; dj <= 1; ++dj)
        for (int di = -1; di <= 1; ++di)
          if (leaves.holds(i + di, j + dj, k + dk)) near[leaves.at(i + di, j + dj, k + dk)] = 1;
  }
  const Int3 cells = {(leaves.dims[0] - 2) * kLeafCells, (leaves.dims[1] - 2) * kLeafCells,
                      (leaves.dims[2] - 2) * kLeafCells};
  std::vector<BandNodes> band;
  Box box;
  for (int k = -1; k < leaves.dims[2] - 1; ++k)
    for (int j = -1; j < leaves.dims[1] - 1; ++j)
      for (int i = -1; i < leaves.dims[0] - 1; ++i) {
        const std::size_t leaf = leaves.at(i, j, k);
        if (!near[leaf]) continue;
        BandNodes out;
        if (wanted && (out.requested = wanted({i, j, k})) == BandNodes().requested) continue;
        for (auto& plane : box) plane.fill(0);
        for (int dk = -1; dk <= 1; ++dk)
          for (int dj = -1; dj <= 1; ++dj)
            for (int di = -1; di <= 1; ++di)
              if (leaves.holds(i + di, j + dj, k + dk))
                if (const auto* marks = leaves.marks_of(leaves.at(i + di, j + dj, k + dk)))
                  paste(*marks, di, dj, dk, box);
        morph<true>(box, kBandClosing);
        morph<false>(box, kBandClosing);
        morph<true>(box, kBandLayers);
        out.leaf = static_cast<std::uint32_t>(leaf);
        const auto inside = nodes_in_block({i, j, k}, cells);
        std::uint64_t any = 0;
        for (std::size_t z = 0; z < 8; ++z) {
          std::uint64_t word = 0;
          for (std::size_t y = 0; y < 8; ++y)
            word |= static_cast<std::uint64_t>(box[z + kBandRadius][y + kBandRadius] >> kBandRadius & 0xff)
                    << (8 * y);
          out.nodes[z] = word & inside[z];
          any |= out.nodes[z];
        }
        if (any) band.push_back(out);
      }
  return band;
}

}  // namespace tessera
