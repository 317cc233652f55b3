/// \file change_cells.h
/// Change as seen from above, in cells of a lattice through zero: how much area was compared and changed, and where most.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "stream/check/fixed_sum.h"
#include "stream/files/external_sort.h"

namespace tessera {

/// A core point that has a distance.
struct PlacedChange {
  Double3 position{};
  double distance = 0.0;
  bool significant = false;
};

struct ChangeCell {
  std::int64_t x = 0, y = 0;      ///< the cell holds [x, x + 1) cells
  std::uint64_t count = 0;        ///< core points with a distance
  std::uint64_t significant = 0;  ///< of them
  double mean = 0.0;              ///< of their distances
};

class ChangeCells {
 public:
  /// \param size  of a cell  \param max_distance  no distance is larger  \param memory_bytes  for sorting
  ChangeCells(double size, double max_distance, const std::filesystem::path& temp,
              std::uint64_t memory_bytes);
  /// Core points, any number at a time: their sums wait, a record for every cell that they lie in. One thread at a time.
  void add(std::span<const PlacedChange> points);
  /// All cells from the north down, then by x, once.
  void drain(const std::function<void(const ChangeCell&)>& sink);
  double size() const { return size_; }
  /// The outermost columns and rows that hold something. \pre some do
  const std::array<std::int64_t, 2>& low() const { return low_; }
  const std::array<std::int64_t, 2>& high() const { return high_; }

 private:
  struct Part {
    std::int64_t x = 0, y = 0;
    std::uint64_t count = 0, significant = 0;
    FixedSum sum;
    bool operator<(const Part& o) const { return y != o.y ? y > o.y : x < o.x; }
  };

  double size_, max_distance_;
  bool any_ = false;
  std::array<std::int64_t, 2> low_{}, high_{};
  ExternalSort<Part> sort_;
};

/// What cells add up to.
struct ChangeArea {
  double cell = 0.0;         ///< size of a cell
  double compared = 0.0;     ///< area of the cells that hold a distance
  double significant = 0.0;  ///< of those in which more than half of the distances are significant
  /// Of these the cells of largest mean distance, either way, the largest first.
  std::vector<ChangeCell> worst;
};
/// \param each  gets every cell, in the order of drain(); may be empty
ChangeArea change_area(ChangeCells& cells, const std::function<void(const ChangeCell&)>& each = {});

}  // namespace tessera
