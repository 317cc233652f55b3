/// \file column_marks.h
/// Columns seen from above, squares of one edge, in blocks of eight by eight: how many points each holds, up to four, and
/// which of them the faces of a mesh cover. Sums and unions of what tasks found are the same in any order.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

inline constexpr int kColumnBlock = 8;               ///< columns along the edge of a block
inline constexpr std::uint32_t kEnoughInColumn = 4;  ///< points, from which on nobody counts

/// Some columns of a block: bit 8 v + u.
struct ColumnMask {
  std::uint64_t key = 0;  ///< of the block: v in the upper half, u in the lower one
  std::uint64_t columns = 0;
  bool operator==(const ColumnMask&) const = default;
};
/// How many points the columns of a block hold, 0 to kEnoughInColumn, bit by bit of their numbers.
struct ColumnCounts {
  std::uint64_t key = 0;
  std::array<std::uint64_t, 3> plane{};
  [[nodiscard]] std::uint64_t enough() const { return plane[2]; }  ///< columns with kEnoughInColumn
  bool operator==(const ColumnCounts&) const = default;
};

/// Column (u, v) of a block, and the key of the block that holds it. \pre below 2^31
[[nodiscard]] constexpr std::uint64_t column_block_key(std::uint32_t u, std::uint32_t v) {
  return std::uint64_t{v / kColumnBlock} << 32 | u / kColumnBlock;
}
[[nodiscard]] constexpr std::uint32_t block_u(std::uint64_t key) {
  return static_cast<std::uint32_t>(key) * kColumnBlock;
}
[[nodiscard]] constexpr std::uint32_t block_v(std::uint64_t key) {
  return static_cast<std::uint32_t>(key >> 32) * kColumnBlock;
}

/// What is known of one block from two sides. \pre of the same block
void merge_columns(ColumnMask& into, const ColumnMask& from);
void merge_columns(ColumnCounts& into, const ColumnCounts& from);  ///< sums, up to kEnoughInColumn
/// Sorts by key and leaves one entry a block.
void combine_columns(std::vector<ColumnMask>& blocks);
void combine_columns(std::vector<ColumnCounts>& blocks);

/// Counts points by column. Fixed memory; a block may come out in several parts.
class ColumnCounter {
 public:
  void add(std::uint32_t u, std::uint32_t v, std::vector<ColumnCounts>& out);
  /// Hands out what is left and starts anew.
  void flush(std::vector<ColumnCounts>& out);

 private:
  struct Slot {
    std::uint64_t key = ~std::uint64_t{0};
    std::array<std::uint8_t, kColumnBlock * kColumnBlock> points{};
  };
  static void hand_out(Slot& slot, std::vector<ColumnCounts>& out);
  std::array<Slot, 64> slots_{};
};

/// Marks the columns that faces cover: those that hold a corner, and those whose middle lies in the face seen from above.
/// Fixed memory; a block may come out in several parts.
class ColumnCover {
 public:
  struct Corner {
    double u = 0.0, v = 0.0;  ///< edges of columns
    std::int32_t column_u = 0, column_v = 0;
  };
  /// \param u, v  edges of columns, finite, below 2^31
  [[nodiscard]] static Corner corner(double u, double v);
  /// What lies at negative coordinates covers nothing.
  void add(std::span<const Corner> corners, std::span<const std::array<std::uint32_t, 3>> faces,
           std::vector<ColumnMask>& out);
  void flush(std::vector<ColumnMask>& out);

 private:
  void mark(std::int32_t u, std::int32_t v, std::vector<ColumnMask>& out);
  void mark_middles(const std::array<Corner, 3>& face, std::vector<ColumnMask>& out);
  static constexpr std::uint64_t kFree = ~std::uint64_t{0};
  std::array<ColumnMask, 64> slots_ = [] {
    std::array<ColumnMask, 64> free{};
    for (ColumnMask& slot : free) slot.key = kFree;
    return free;
  }();
};

}  // namespace tessera
