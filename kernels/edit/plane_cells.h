/// \file plane_cells.h
/// Points of a scan summed up in cubic cells: a mean and a normal for every cell around which the scan is a plane. Sums are whole
/// numbers, so neither the order of the points nor how they are read makes a difference.
///
/// Source: Hoppe et al., "Surface reconstruction from unorganized points", 1992: the plane of a neighbourhood by its covariance,
/// here that of the 27 cells around.
#pragma once
#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "octree/vector.h"

namespace tessera {

struct PlaneCell {
  Double3 at{};              ///< mean of its points and of those in the cells above and below
  Double3 normal{};          ///< unit; its side is known where `oriented`
  std::uint32_t points = 0;  ///< at most 2^32 - 1 are told
  std::uint32_t oriented = 0;
};

struct PlaneCellReport {
  std::uint64_t points = 0;   ///< in the box
  std::uint64_t outside = 0;  ///< beside it, or not finite
  std::uint64_t cells = 0;    ///< that hold points
  double edge = 0.0;          ///< of the cells
};

class PlaneCells {
 public:
  static constexpr std::size_t kMaxCells = std::size_t{1} << 18;  ///< while points come; more become coarser
  static constexpr std::uint64_t kBytes = kMaxCells * 400;        ///< upper bound of what it allocates

  /// \param edge  of the finest cells, units of the scan \pre low <= high, (high - low) / edge <= 2^20
  PlaneCells(const Double3& low, const Double3& high, double edge);
  /// \param normal  out of the surface, of any length; zero where unknown
  void add(const Double3& p, const Double3& normal);
  /// The planar cells, by their place: of the finest level at which a cell has eight points in the mean and half of the cells
  /// are planar; else of the one with the largest share of planar ones.
  std::vector<PlaneCell> finish(PlaneCellReport& report);

 private:
  struct Sums {
    std::uint64_t count = 0;
    std::array<std::int64_t, 3> sum{};      ///< from the cell's corner, in steps
    std::array<std::int64_t, 6> squares{};  ///< xx, xy, xz, yy, yz, zz
    std::array<std::int64_t, 3> normal{};
    void add(const Sums& child, const std::array<std::int64_t, 3>& shift);
  };
  using Cells = std::unordered_map<std::uint64_t, Sums>;
  void coarsen();
  std::vector<PlaneCell> planar() const;
  int bits() const { return kStepBits + level_; }

  static constexpr int kStepBits = 8;  ///< steps an edge of the finest cells
  Double3 low_, high_;
  double step_;
  int level_ = 0;
  Cells cells_;
  std::uint64_t points_ = 0, outside_ = 0;
};

}  // namespace tessera
