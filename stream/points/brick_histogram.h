/// \file brick_histogram.h
/// Sparse count of points per brick, and of its blocks that hold any, while nothing is known of the extent: bricks are
/// named by signed coordinates in units of 64 h from the world's zero. Bounded memory: full tables are spilled as sorted
/// runs, sections of a packed file.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "octree/lattice.h"
#include "stream/files/packed_file.h"

namespace tessera {

using BrickCoord = std::array<std::int64_t, 3>;

struct BrickCount {
  BrickCoord brick{};
  std::uint64_t points = 0;
  std::array<std::uint64_t, 8> blocks{};  ///< one bit for each of the brick's 8^3 blocks of 8^3 cells
};

/// Counts one task's points and writes them to a run file.
class BrickCounter {
 public:
  /// \param capacity  bricks held before a spill; memory is 288 bytes each at most
  BrickCounter(const std::filesystem::path& file, std::size_t capacity = std::size_t{1} << 17);
  /// A point in block `block` of the world, in units of 8 h.
  void add(const BrickCoord& block) {
    constexpr int kShift = kBrickBits - kLeafBits;
    const BrickCoord brick = {block[0] >> kShift, block[1] >> kShift, block[2] >> kShift};
    if (brick != last_) find(brick);
    BrickCount& count = slots_[last_slot_];
    ++count.points;
    count.blocks[static_cast<std::size_t>(block[2] & 7)] |= std::uint64_t{1}
                                                            << ((block[1] & 7) << 3 | (block[0] & 7));
  }
  /// Spills the rest, closes. Returns bytes written.
  std::uint64_t finish();

 private:
  void find(const BrickCoord& brick);
  std::size_t slot_of(const BrickCoord& brick) const;  ///< its own, or a free one
  void grow();
  void spill();

  PackedWriter file_;
  std::vector<Section> runs_;
  std::size_t capacity_;
  std::size_t used_ = 0;
  std::vector<BrickCount> slots_;  ///< open addressing, points == 0 = free; half of them at most are used
  BrickCoord last_;
  std::size_t last_slot_ = 0;
};

/// Sum of all run files, ascending (x, y, z). Memory 192 bytes a brick.
/// \throws ResourceError when there are more than `max_bricks` bricks; InputError for a damaged file
std::vector<BrickCount> merge_brick_counts(const std::vector<std::filesystem::path>& files,
                                           std::size_t max_bricks);

/// The bricks that belong to the scan, min and max inclusive.
struct BrickWindow {
  BrickCoord min{}, max{};
  std::uint64_t dropped_points = 0;  ///< outside
  bool holds(const BrickCoord& b) const {
    return b[0] >= min[0] && b[0] <= max[0] && b[1] >= min[1] && b[1] <= max[1] && b[2] >= min[2] &&
           b[2] <= max[2];
  }
};

/// Drops what is absurd: farther from the median than 1000 times the largest extent of the middle 98 %; and,
/// when the rest would not fit the lattice, what lies outside the widest lattice around the median, if that
/// is less than a thousandth of the points. \pre bricks not empty \throws InputError when the extent exceeds
/// 2^20 cells all the same, naming the smallest h that would do
BrickWindow robust_window(const std::vector<BrickCount>& bricks, double h);

/// The lowest occupied block within the window, and the one above the highest, in units of 8 h.
std::array<std::int64_t, 2> occupied_heights(const std::vector<BrickCount>& bricks,
                                             const BrickWindow& window);

}  // namespace tessera
