/// \file top_surface.h
/// Scenes seen from above: their highest surface, column by column, whether they are that, and what it says of the sides of
/// surfels. Nobody looks up from below the ground: what lies level shows upwards, and the free side of what is steep is the
/// one where the top is lower.
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
  /// \param group  of every patch: surfaces end where groups do; empty = patches are groups
  TopSurface(std::span<const JobSurfel> surfels, const Float3& up, std::span<const std::uint32_t> group = {});

  /// Share of the level area that lies well below the top of its column: 12 cells, in small scenes a sixth of their width.
  /// Balls and rooms have a half, bare land and towns next to none, forests as much as balls.
  double covered_share() const { return covered_share_; }
  /// The same below the highest level surface of one group that is wide: below ceilings and the upper sides of objects. Crowns
  /// of trees are no surface of such a width.
  double roofed_share() const { return roofed_share_; }
  /// How much of its area the scene shows along up: a half where it faces every way, all of level ground.
  double level_share() const { return level_share_; }
  /// Little is covered; or it is by crowns alone, and the scene is large enough to tell them from ceilings.
  bool seen_from_above() const;

  /// Votes for the side that patches show, as VisibilityVotes::sides.
  /// \param scale  weight of one fine surfel's vote
  std::vector<PatchVote> votes(std::size_t patches, double scale) const;

 private:
  struct Column {
    std::uint64_t key;
    float top;             ///< along up, cells
    std::uint32_t surfel;  ///< that reaches it
  };
  struct ColumnHeight {
    std::int64_t u, v;
    float height;
  };
  ColumnHeight column_height(const Float3& position) const;
  /// Of those surfels that `counts` takes. \returns ascending key
  template <class Counts>
  std::vector<Column> tops(Counts&& counts) const;
  static const Column* find(const std::vector<Column>& columns, const ColumnHeight& at);
  /// Area along up of the level surfels whose planes pass so far below the top of their column.
  double area_below(const std::vector<Column>& columns, float depth) const;
  void measure(std::span<const std::uint32_t> group);
  /// \returns the top of the column; less than everything where there is none
  float top(const ColumnHeight& at) const;
  double steep_side(const JobSurfel& s, const ColumnHeight& at, float across) const;

  std::span<const JobSurfel> surfels_;
  Float3 up_, u_, v_;
  std::vector<Column> columns_;  ///< ascending key
  double covered_share_ = 1.0, roofed_share_ = 1.0, level_share_ = 0.0;
};

}  // namespace tessera
