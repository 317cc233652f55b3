/// \file value_cells.h
/// What a picture shows of any number of points with a value each: the means of cells of space, in bounded memory, and the
/// worst places. Sums are of integers, so that neither threads nor memory nor the order of points matters.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// A cell that holds points.
struct ValueCell {
  Double3 centre{};   ///< mean of the points' positions
  double mean = 0.0;  ///< of their values; NaN where none has one
};

/// A point whose value is the largest, either way, of all around it.
struct WorstPlace {
  Double3 at{};
  double value = 0.0;
};

struct ValueMap {
  std::vector<ValueCell> cells;   ///< in an order that hangs on the points alone
  double cell = 0.0;              ///< edge, scan units
  std::vector<WorstPlace> worst;  ///< at most kWorstPlaces, the largest first
};

class ValueCells {
 public:
  static constexpr std::size_t kMaxCells = std::size_t{1} << 18;
  static constexpr std::size_t kWorstPlaces = 10;

  /// \param low, high  box outside of which points are not shown, finite \param max_value  no value is larger either way, > 0
  /// \param max_cells  1 to kMaxCells
  ValueCells(const Double3& low, const Double3& high, double max_value, std::size_t max_cells = kMaxCells);
  /// That it takes, and finish() beside it.
  static std::uint64_t bytes();

  /// A point; a value of NaN is none. \pre finite
  void add(const Double3& p, double value);
  /// Once. Worst places keep a twentieth of the box's longest side apart.
  ValueMap finish();

 private:
  struct Cell {
    std::uint64_t key = 0;  ///< its three indices
    std::uint64_t points = 0, valued = 0;
    std::array<std::uint64_t, 3> sum{};  ///< of positions, steps
    std::int64_t value = 0;              ///< sum, steps of values
    WorstPlace worst;
  };
  static bool is_worse(const WorstPlace& a, const WorstPlace& b);
  static void merge(Cell& into, const Cell& cell);
  std::uint32_t& slot_of(std::uint64_t key);
  void coarsen();
  std::vector<WorstPlace> worst_places();

  Double3 low_, high_;
  std::size_t max_cells_;
  double step_ = 1.0, value_step_ = 1.0;
  unsigned shift_ = 0;  ///< from steps to cells
  std::vector<Cell> cells_;
  std::vector<std::uint32_t> slots_;  ///< open addressing; index into cells_ and one, 0 = free
};

}  // namespace tessera
