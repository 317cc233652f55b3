/// \file top_surface.h
/// Scenes seen from above: their highest surface, column by column, and what it says of the sides of surfels. Nobody looks
/// up from below the ground: what lies level shows upwards, and the free side of what is steep is the one where the top is
/// lower.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/points/sign_solver.h"
#include "kernels/points/surfel_scene.h"

namespace tessera {

/// The highest surfel over every occupied square of kCoarseCells across `up`.
class TopSurface {
 public:
  /// \param up  unit
  TopSurface(std::span<const JobSurfel> surfels, const Float3& up);

  /// Share of the level area that lies well below the top of its column: balls and rooms have a half, land next to none.
  double covered_share() const { return covered_share_; }

  /// Votes for the side that groups show, as SightVotes::sides.
  /// \param scale  weight of one fine surfel's vote
  std::vector<PatchVote> votes(std::size_t groups, double scale) const;

 private:
  struct Column {
    std::uint64_t key;
    float top;  ///< along up, cells
  };
  struct ColumnHeight {
    std::int64_t u, v;
    float height;
  };
  ColumnHeight column_height(const Float3& position) const;
  /// \returns the top of the column; less than everything where there is none
  float top(std::int64_t u, std::int64_t v) const;
  double steep_side(const JobSurfel& s, const ColumnHeight& at, float across) const;

  std::span<const JobSurfel> surfels_;
  Float3 up_, u_, v_;
  std::vector<Column> columns_;  ///< ascending key
  double covered_share_ = 0.0;
};

}  // namespace tessera
