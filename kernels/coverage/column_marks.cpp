#include "kernels/coverage/column_marks.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tessera {
namespace {

constexpr std::size_t column_slot(std::uint64_t key) {
  return static_cast<std::size_t>((key & 7) | (key >> 32 & 7) << 3);
}

constexpr std::uint64_t column_bit(std::uint32_t u, std::uint32_t v) {
  return std::uint64_t{1} << (v % kColumnBlock * kColumnBlock + u % kColumnBlock);
}

template <class Block>
void combine_blocks(std::vector<Block>& blocks) {
  std::sort(blocks.begin(), blocks.end(), [](const Block& a, const Block& b) { return a.key < b.key; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (kept > 0 && blocks[kept - 1].key == blocks[i].key)
      merge_columns(blocks[kept - 1], blocks[i]);
    else
      blocks[kept++] = blocks[i];
  }
  blocks.resize(kept);
}

}  // namespace

void merge_columns(ColumnMask& into, const ColumnMask& from) {
  into.columns |= from.columns;
}

void merge_columns(ColumnCounts& into, const ColumnCounts& from) {
  const auto& a = into.plane;
  const auto& b = from.plane;
  const std::uint64_t carry = a[0] & b[0];
  const std::uint64_t full = a[2] | b[2] | (a[1] & b[1]) | ((a[1] | b[1]) & carry);
  into.plane = {(a[0] ^ b[0]) & ~full, (a[1] ^ b[1] ^ carry) & ~full, full};
}

void combine_columns(std::vector<ColumnMask>& blocks) {
  combine_blocks(blocks);
}
void combine_columns(std::vector<ColumnCounts>& blocks) {
  combine_blocks(blocks);
}

void ColumnCounter::hand_out(Slot& slot, std::vector<ColumnCounts>& out) {
  if (slot.key == Slot{}.key) return;
  ColumnCounts counts{slot.key, {}};
  for (std::size_t c = 0; c < slot.points.size(); ++c)
    for (std::size_t bit = 0; bit < counts.plane.size(); ++bit)
      counts.plane[bit] |= std::uint64_t{slot.points[c] >> bit & 1u} << c;
  out.push_back(counts);
  slot = Slot{};
}

void ColumnCounter::add(std::uint32_t u, std::uint32_t v, std::vector<ColumnCounts>& out) {
  const std::uint64_t key = column_block_key(u, v);
  Slot& slot = slots_[column_slot(key)];
  if (slot.key != key) {
    hand_out(slot, out);
    slot.key = key;
  }
  std::uint8_t& points = slot.points[v % kColumnBlock * kColumnBlock + u % kColumnBlock];
  if (points < kEnoughInColumn) ++points;
}

void ColumnCounter::flush(std::vector<ColumnCounts>& out) {
  for (Slot& slot : slots_) hand_out(slot, out);
}

void ColumnCover::mark(std::int32_t u, std::int32_t v, std::vector<ColumnMask>& out) {
  if (u < 0 || v < 0) return;
  const auto at_u = static_cast<std::uint32_t>(u), at_v = static_cast<std::uint32_t>(v);
  const std::uint64_t key = column_block_key(at_u, at_v);
  ColumnMask& slot = slots_[column_slot(key)];
  if (slot.key != key) {
    if (slot.key != kFree) out.push_back(slot);
    slot = {key, 0};
  }
  slot.columns |= column_bit(at_u, at_v);
}

ColumnCover::Corner ColumnCover::corner(double u, double v) {
  return {u, v, static_cast<std::int32_t>(std::floor(u)), static_cast<std::int32_t>(std::floor(v))};
}

void ColumnCover::add(std::span<const Corner> corners, std::span<const std::array<std::uint32_t, 3>> faces,
                      std::vector<ColumnMask>& out) {
  std::vector<std::uint8_t> used(corners.size(), 0);
  for (const auto& f : faces)
    for (const std::uint32_t v : f) used[v] = 1;
  for (std::size_t v = 0; v < corners.size(); ++v)
    if (used[v] != 0) mark(corners[v].column_u, corners[v].column_v, out);
  for (const auto& f : faces) mark_middles({corners[f[0]], corners[f[1]], corners[f[2]]}, out);
}

/// Of columns that hold none of the corners.
void ColumnCover::mark_middles(const std::array<Corner, 3>& face, std::vector<ColumnMask>& out) {
  std::int32_t low_u = face[0].column_u, high_u = low_u, low_v = face[0].column_v, high_v = low_v;
  for (const Corner& c : face) {
    low_u = std::min(low_u, c.column_u), high_u = std::max(high_u, c.column_u);
    low_v = std::min(low_v, c.column_v), high_v = std::max(high_v, c.column_v);
  }
  if (high_u - low_u + high_v - low_v <= 1) return;  // each of these holds a corner
  double au = face[1].u - face[0].u, av = face[1].v - face[0].v;
  double bu = face[2].u - face[0].u, bv = face[2].v - face[0].v;
  double area = au * bv - av * bu;
  if (area == 0.0) return;
  if (area < 0.0) std::swap(au, bu), std::swap(av, bv), area = -area;
  for (std::int32_t v = low_v; v <= high_v; ++v)
    for (std::int32_t u = low_u; u <= high_u; ++u) {
      const double pu = u + 0.5 - face[0].u, pv = v + 0.5 - face[0].v;
      const double s = pu * bv - pv * bu, t = au * pv - av * pu;
      if (s >= 0.0 && t >= 0.0 && s + t <= area) mark(u, v, out);
    }
}

void ColumnCover::flush(std::vector<ColumnMask>& out) {
  for (ColumnMask& slot : slots_) {
    if (slot.key != kFree) out.push_back(slot);
    slot = {kFree, 0};
  }
}

}  // namespace tessera
