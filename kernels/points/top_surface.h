/// \file top_surface.h
/// Scenes seen from above: their highest surface, column by column, whether they are that, and what it says of the sides of
/// surfels. Nobody looks up from below the ground: what lies level shows upwards, and the free side of what is steep is the
/// one where the top is lower.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "kernels/points/sign_solver.h"
#include "kernels/points/surfel_scene.h"

namespace tessera {

/// The highest surfel over every occupied square of kCoarseCells across `up`.
class TopColumns {
 public:
  struct Column {
    std::uint64_t key = 0;
    float top = 0.0f;   ///< along up, cells
    Float3 position{};  ///< of the surfel that reaches it
  };

  /// \param up  unit
  explicit TopColumns(const Float3& up);
  /// \param columns  ascending key
  TopColumns(const Float3& up, std::vector<Column> columns);

  /// Of equally high surfels the first one counts.
  template <class Counts>
  void add(std::span<const JobSurfel> surfels, Counts&& counts);
  /// After the last add().
  void finish();

  [[nodiscard]] std::span<const Column> columns() const { return columns_; }
  [[nodiscard]] const Float3& up() const { return up_; }
  [[nodiscard]] const Column* find(const Float3& position) const;  ///< null where nothing was seen
  [[nodiscard]] float top(const Float3& position) const;  ///< less than everything where nothing was seen

 private:
  Column column_at(const Float3& position) const;
  void merge();

  Float3 up_, u_, v_;
  std::vector<Column> columns_;  ///< ascending key after finish()
  std::size_t merge_at_ = 0;
};

/// Surfels of a job in batches, visited in the same order every time. `group` of a patch of the batch; empty = patches are
/// groups. Groups do not span batches.
using SurfelBatch =
    std::function<void(std::span<const JobSurfel> surfels, std::span<const std::uint32_t> group)>;
using SurfelBatches = std::function<void(const SurfelBatch& visit)>;

/// How much of a scene lies below its highest surface.
class TopSurface {
 public:
  /// Three visits of all batches; memory grows with the columns and with the largest batch.
  TopSurface(const Float3& up, const SurfelBatches& batches);
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
  /// Share of the columns that hold a wide level surface: most of a landscape, however much of it lies below crowns; none of a
  /// plant.
  double ground_share() const { return ground_share_; }
  /// Little is covered; or it is by crowns alone, and the scene is large enough to tell them from ceilings. From stations on
  /// the ground crowns show more flanks than level surface: there the ground below them tells, of few columns that alone.
  [[nodiscard]] bool seen_from_above() const;

  [[nodiscard]] const TopColumns& columns() const { return columns_; }

 private:
  TopColumns columns_;
  double covered_share_ = 1.0, roofed_share_ = 1.0, level_share_ = 0.0, ground_share_ = 0.0;
};

/// Votes for the side that patches show, as VisibilityVotes::sides.
/// \param surfels  of these patches, in their signs; `columns` of the whole job
/// \param scale  weight of one fine surfel's vote
[[nodiscard]] std::vector<PatchVote> vote_by_top(std::span<const JobSurfel> surfels,
                                                 const TopColumns& columns, std::size_t patches,
                                                 double scale);

}  // namespace tessera
