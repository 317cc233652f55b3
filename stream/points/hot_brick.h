/// \file hot_brick.h
/// Bricks with more points than a job allows (next to a scanner, or everything at one place): thinned in a
/// stream, in memory that does not grow with what comes in, to a result that does not depend on the order it
/// comes in.
///
/// Rule: a cell keeps at most c different positions, those with the smallest hash of their position, where c
/// is the largest number for which the raw counts give at most the limit: sum over cells of min(count, c) <=
/// limit, but at least 1. So sparse parts of the brick stay as they are.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "stream/points/point_sort.h"

namespace tessera {

class HotBrick {
 public:
  /// \param limit  points to keep
  /// \param chunk  points taken in before the next pruning; changes no result
  HotBrick(std::uint64_t limit, std::size_t chunk);

  /// First pass, every point.
  void count(std::span<const PointRecord> points);
  /// Second pass, every point again.
  void add(std::span<const PointRecord> points);
  /// Canonical order; what was added is spent. `merged` is the number of points that fell on a kept position.
  std::vector<PointRecord> take();
  /// Points that were added and neither kept nor merged into one that is kept.
  std::uint64_t thinned() const { return thinned_; }
  std::uint64_t merged() const { return merged_; }
  std::uint64_t per_cell() const { return per_cell_; }

  /// Upper bound of its memory.
  static std::uint64_t bytes(std::uint64_t limit, std::uint64_t chunk);

 private:
  struct Entry {
    std::uint32_t cell;  ///< index in the brick
    std::uint64_t hash;  ///< of the position
    std::uint64_t points;
    MergedPoint point;
  };
  void choose_per_cell();
  void prune();

  std::uint64_t limit_;
  std::size_t chunk_;
  std::uint64_t per_cell_ = 0;  ///< 0 = not chosen yet
  std::uint64_t merged_ = 0, thinned_ = 0;
  std::vector<std::uint64_t> cell_points_;
  std::vector<Entry> entries_;
  std::size_t pruned_ = 0;  ///< held after the last pruning
};

}  // namespace tessera
