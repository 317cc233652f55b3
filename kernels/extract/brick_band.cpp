#include "kernels/extract/brick_band.h"

#include <cassert>

#include "octree/morton.h"

namespace tessera {
namespace {

constexpr std::uint64_t kFirstColumn = 0x0101010101010101ULL;  // x = 0
constexpr std::uint64_t kLastColumn = 0x8080808080808080ULL;   // x = 7
constexpr std::uint64_t kFirstRow = 0xff;                      // y = 0
constexpr std::uint64_t kLastRow = 0xff00000000000000ULL;      // y = 7

/// Bit (x, y) of the result is bit (x+1, y) of the row of leaves (word, next).
std::uint64_t from_next_x(std::uint64_t word, std::uint64_t next) {
  return (word >> 1 & ~kLastColumn) | (next & kFirstColumn) << 7;
}
std::uint64_t from_next_y(std::uint64_t word, std::uint64_t next) {
  return word >> 8 | next << 56;
}
/// Bit (x, y) of the result is bit (x-1, y).
std::uint64_t from_last_x(std::uint64_t word, std::uint64_t last) {
  return (word << 1 & ~kFirstColumn) | (last & kLastColumn) >> 7;
}
std::uint64_t from_last_y(std::uint64_t word, std::uint64_t last) {
  return word << 8 | last >> 56;
}

constexpr std::uint64_t kAll = ~std::uint64_t{0};

/// Cells of the brick and its halo: those with the last coordinate only in leaf -1, with the first in leaf 8.
std::uint64_t cell_window(const Int3& at, std::size_t z) {
  if ((at[2] < 0 && z != 7) || (at[2] >= kBrickLeaves && z != 0)) return 0;
  return (at[0] < 0               ? kLastColumn
          : at[0] >= kBrickLeaves ? kFirstColumn
                                  : kAll) &
         (at[1] < 0               ? kLastRow
          : at[1] >= kBrickLeaves ? kFirstRow
                                  : kAll);
}

}  // namespace

void BrickBand::collect(const DirectedField& field, const Int3& corner, bool with_halo) {
  find_leaves(field, corner);
  for (LeafMasks& m : masks_) mark_cells(m, with_halo);
  own_vertices_ = foreign_vertices_ = active_cells_ = 0;
  for (LeafMasks& m : masks_) {
    mark_edges(m);
    number(m);
  }
}

void BrickBand::find_leaves(const DirectedField& field, const Int3& corner) {
  index_.fill(-1);
  masks_.clear();
  const auto add = [&](int i, int j, int k) {
    const BandLeaf* leaf =
        field.leaf_at(corner[0] + i * kLeafCells, corner[1] + j * kLeafCells, corner[2] + k * kLeafCells);
    if (!leaf) return;
    index_[slot(i, j, k)] = static_cast<std::int16_t>(masks_.size());
    masks_.emplace_back();
    masks_.back().leaf = leaf;
    masks_.back().at = {i, j, k};
    masks_.back().valid = leaf->valid();
    masks_.back().inside = leaf->inside;
  };
  for (std::uint64_t code = 0; code < kBrickLeaves * kBrickLeaves * kBrickLeaves; ++code) {
    const auto c = morton_decode(code);
    add(static_cast<int>(c[0]), static_cast<int>(c[1]), static_cast<int>(c[2]));
  }
  for (int k = -1; k <= kBrickLeaves; ++k) {
    for (int j = -1; j <= kBrickLeaves; ++j) {
      const bool inner_row = k >= 0 && k < kBrickLeaves && j >= 0 && j < kBrickLeaves;
      for (int i = -1; i <= kBrickLeaves; i += inner_row ? kBrickLeaves + 1 : 1) add(i, j, k);
    }
  }
}

BrickBand::CornerWords BrickBand::corner_words(const LeafMasks& m, LeafWords LeafMasks::*words) const {
  static const LeafWords kEmpty{};
  std::array<std::array<const LeafWords*, 4>, 2> n;  // [+z][+x + 2 (+y)]
  for (int d = 0; d < 8; ++d) {
    const Int3 leaf = {m.at[0] + (d & 1), m.at[1] + (d >> 1 & 1), m.at[2] + (d >> 2)};
    const bool known = leaf[0] <= kBrickLeaves && leaf[1] <= kBrickLeaves && leaf[2] <= kBrickLeaves;
    const LeafMasks* other = known ? at(leaf[0], leaf[1], leaf[2]) : nullptr;
    n[static_cast<std::size_t>(d >> 2)][static_cast<std::size_t>(d & 3)] = other ? &(other->*words) : &kEmpty;
  }
  CornerWords out;
  for (std::size_t z = 0; z < 9; ++z) {
    const auto& row = n[z >> 3];
    const std::uint64_t here = (*row[0])[z & 7], y = (*row[2])[z & 7];
    const std::uint64_t here_x = from_next_x(here, (*row[1])[z & 7]);
    const std::uint64_t y_x = from_next_x(y, (*row[3])[z & 7]);
    out[z] = {here, here_x, from_next_y(here, y), from_next_y(here_x, y_x)};
  }
  return out;
}

void BrickBand::mark_cells(LeafMasks& m, bool with_halo) {
  int below = 0, above = 0;
  for (int c : m.at) below += c < 0, above += c >= kBrickLeaves;
  const bool wants_active = above == 0 && (below == 0 || (below == 1 && with_halo));
  const auto valid = corner_words(m, &LeafMasks::valid);
  const auto inside = corner_words(m, &LeafMasks::inside);
  std::array<std::uint64_t, 9> all_valid, all_inside, any_inside;
  for (std::size_t z = 0; z < 9; ++z) {
    const auto& v = valid[z];
    const auto& s = inside[z];
    all_valid[z] = v[0] & v[1] & v[2] & v[3];
    all_inside[z] = s[0] & s[1] & s[2] & s[3];
    any_inside[z] = s[0] | s[1] | s[2] | s[3];
  }
  for (std::size_t z = 0; z < 8; ++z) {
    m.cells[z] =
        ((all_valid[z] & all_valid[z + 1] & ~m.leaf->ended[z]) | m.leaf->closing[z]) & cell_window(m.at, z);
    if (!wants_active) continue;
    m.active[z] = m.cells[z] & (any_inside[z] | any_inside[z + 1]) & ~(all_inside[z] & all_inside[z + 1]) &
                  ~m.leaf->quiet[z];
    m.any_active |= m.active[z] != 0;
  }
}

void BrickBand::mark_edges(LeafMasks& m) const {
  for (int c : m.at)
    if (c < 0) return;  // edges of nodes below the brick are never named by it
  static const LeafMasks kEmpty{};
  std::array<std::array<const LeafMasks*, 4>, 2> n;  // [-z][-x + 2 (-y)]
  for (int d = 0; d < 8; ++d) {
    const LeafMasks* other = at(m.at[0] - (d & 1), m.at[1] - (d >> 1 & 1), m.at[2] - (d >> 2));
    n[static_cast<std::size_t>(d >> 2)][static_cast<std::size_t>(d & 3)] = other ? other : &kEmpty;
  }
  // Valid cells at (x - dx, y - dy) by dx + 2 dy, for z = -1 .. 7.
  std::array<std::array<std::uint64_t, 4>, 9> v;
  for (std::size_t z = 0; z < 9; ++z) {
    const auto& row = n[z == 0 ? 1 : 0];
    const std::size_t w = z == 0 ? 7 : z - 1;
    const std::uint64_t last_x = from_last_x(row[0]->cells[w], row[1]->cells[w]);
    v[z] = {row[0]->cells[w], last_x, from_last_y(row[0]->cells[w], row[2]->cells[w]),
            from_last_y(last_x, from_last_x(row[2]->cells[w], row[3]->cells[w]))};
  }
  for (std::size_t z = 0; z < 8; ++z) {
    const auto& here = v[z + 1];
    const auto& down = v[z];
    const auto mark = [&](std::size_t axis, std::uint64_t a, std::uint64_t b, std::uint64_t c,
                          std::uint64_t d) {
      const std::uint64_t e = m.leaf->crossing[axis][z] & (a | b | c | d) & cell_window(m.at, z);
      m.edges[axis][z] = e;
      m.split[axis][z] = e & ((a & d & ~b & ~c) | (b & c & ~a & ~d));
      m.border[axis][z] = e & ~(a & b & c & d);
    };
    mark(0, down[2], down[0], here[2], here[0]);  // u = y, v = z
    mark(1, down[1], here[1], down[0], here[0]);  // u = z, v = x
    mark(2, here[3], here[2], here[1], here[0]);  // u = x, v = y
  }
}

LeafWords BrickBand::boundary_cells(const LeafMasks& m) const {
  static const LeafWords kEmpty{};
  const auto cells = [&](int i, int j, int k) -> const LeafWords& {
    const LeafMasks* other = at(m.at[0] + i, m.at[1] + j, m.at[2] + k);
    return other ? other->cells : kEmpty;
  };
  const LeafWords &left = cells(-1, 0, 0), &right = cells(1, 0, 0), &front = cells(0, -1, 0),
                  &back = cells(0, 1, 0), &down = cells(0, 0, -1), &up = cells(0, 0, 1);
  LeafWords boundary;
  for (std::size_t z = 0; z < 8; ++z) {
    const std::uint64_t here = m.cells[z];
    const std::uint64_t around = from_last_x(here, left[z]) & from_next_x(here, right[z]) &
                                 from_last_y(here, front[z]) & from_next_y(here, back[z]) &
                                 (z > 0 ? m.cells[z - 1] : down[7]) & (z < 7 ? m.cells[z + 1] : up[0]);
    boundary[z] = here & ~around;
  }
  return boundary;
}

void BrickBand::number(LeafMasks& m) {
  for (std::size_t z = 0; z < 8; ++z) {
    m.first_cell[z] = active_cells_;
    active_cells_ += static_cast<std::uint32_t>(std::popcount(m.active[z]));
  }
  const bool own = m.own();
  std::uint32_t& next = own ? own_vertices_ : foreign_vertices_;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t z = 0; z < 8; ++z) {
      m.first_vertex[axis][z] = next;
      next += static_cast<std::uint32_t>(std::popcount(m.edges[axis][z]));
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t z = 0; z < 8; ++z) {
      m.first_split[axis][z] = next;
      next += static_cast<std::uint32_t>(std::popcount(m.split[axis][z]));
    }
  }
}

}  // namespace tessera
