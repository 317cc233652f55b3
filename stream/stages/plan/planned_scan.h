/// \file planned_scan.h
/// What is known of a reconstruction when its survey is done: what its stages tell their forecasts from.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "octree/vector.h"
#include "stream/points/plan.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/options.h"
#include "stream/stages/plan/planned_patches.h"
#include "stream/stages/plan/stage_forecast.h"
#include "stream/stages/plan/tile.h"

namespace tessera {

/// Tasks that read the input once.
struct InputTasks {
  std::uint64_t count = 0;
  std::uint64_t largest_bytes = 0;   ///< of the input, in one of them
  std::uint64_t unpacked_bytes = 0;  ///< on disk until distribute is done
};

/// Brick columns of a plan, by the axes as one sees them from above.
struct PlannedColumns {
  std::map<std::pair<int, int>, std::uint64_t> points;
  std::uint64_t fullest = 0;           ///< points of a column
  std::int64_t width = 0, height = 0;  ///< of all
  /// Of their number those in which bricks without a point lie between others: ceilings leave some above floors, slopes none and
  /// crowns few.
  double gapped_share = 0.0;
  static constexpr std::size_t kTelling = 64;  ///< of fewer columns it tells nothing
  bool look_open() const { return points.size() >= kTelling && gapped_share < 0.1; }
  bool look_closed() const { return points.size() >= kTelling && gapped_share > 0.4; }
};

struct PlannedScan {
  const Plan& plan;
  const RunOptions& run;
  ReconstructOptions options;
  InputTasks inputs;
  std::span<const PlanBrick> plan_bricks;
  std::vector<BrickEntry> bricks = {};       ///< as ordered points will have them, hot ones thinned
  std::uint64_t largest_brick = 0;           ///< points
  std::uint64_t blocks = 0, max_blocks = 0;  ///< occupied blocks of 8^3 cells: of all bricks, of the fullest
  double points = 0.0, faces = 0.0;
  std::uint64_t run_bytes = 0, store_bytes = 0,
                overlay_bytes = 0;   ///< on disk: runs, ordered points, normals
  std::uint64_t surface_bytes = 0;   ///< on disk: the surface of full resolution
  std::uint64_t smoothed_bytes = 0;  ///< on disk: its smoothed vertices
  std::uint64_t output_bytes = 0;    ///< of the mesh file

  bool has_overlay = false;         ///< the normals stage runs
  bool estimates_normals = false;   ///< and fits planes
  bool knows_sides = false;         ///< the points know from where they were seen
  bool oriented_in_blocks = false;  ///< patches know their sides; else nobody knows yet what the scan is of
  std::optional<PlannedColumns> columns = {};  ///< where a surface model may be made
  bool closes = false;                         ///< --holes close
  bool fuses_stores = false;                   ///< the surface goes to stores, not to patches that are welded
  std::uint32_t max_hole_edges = 0;            ///< of holes that are filled; 0 = none
  std::uint32_t max_chained_edges = 0;         ///< of holes that no brick sees whole; 0 = none
  std::uint64_t filling_bytes = 0;             ///< of a batch of fillings

  /// Whether it looks like rooms, which get no surface model.
  bool is_room() const { return columns && columns->look_closed(); }

  int halo = 0;  ///< cells, of the field
  std::vector<TileGroup> groups = {};
  PlannedPatches patches = {};
  PatchEntry largest_patch = {};

  /// `use(tile)` of every tile.
  template <class Use>
  void for_each_tile(const Use& use) const {
    for (const TileGroup& group : groups)
      for (const Tile& tile : group) use(tile);
  }
};

/// \returns count things of `each` bytes
inline std::uint64_t bytes_of(double count, double each) {
  return static_cast<std::uint64_t>(count * each);
}

}  // namespace tessera
