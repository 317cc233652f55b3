/// \file surface_stage.h
/// Pass "surface": oriented points of every tile and its halo -> field -> patches, one per brick; with a tolerance ->
/// the first pass of decimation (first_pass.h).
#pragma once
#include <functional>

#include "kernels/extract/extended_marching_cubes.h"
#include "kernels/field/field.h"
#include "stream/points/closing_store.h"
#include "stream/points/plan.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stage.h"
#include "stream/stages/plan/tile.h"

namespace tessera {

struct TilingOptions {
  int halo_cells = 0;
  int tile_bricks = 0;                         ///< edge of a tile in bricks; 0 = the largest that fits
  const BrickSectionStore* closing = nullptr;  ///< cells that close holes, also where no point is
  /// Memory one tile may take; tiles over it are split down to one brick.
  std::uint64_t tile_bytes_limit = 0;
};

/// Upper bound of the memory that computing a tile takes, from the brick tables alone.
std::uint64_t tile_bytes(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                         const Tile& tile, int halo_cells);
/// Its two shares: the band and its leaves; points, with their dipoles where holes are closed.
std::uint64_t tile_band_bytes(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                              const Tile& tile, int halo_cells);
std::uint64_t tile_point_bytes(std::uint64_t points, const BrickSectionStore* closing);

/// Most faces that a tile's patches are expected to have, from the brick tables alone.
std::uint64_t tile_faces(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                         const Tile& tile, int halo_cells);

/// Cuts the lattice around the points into groups of tiles. The groups (and so the tasks) depend on the points
/// only; the tiles inside depend on the options. Tiles that no point can reach are left out.
std::vector<TileGroup> make_tile_groups(std::span<const BrickEntry> bricks, const TilingOptions& options);

/// Points of the block's core.
std::uint64_t core_points(const PointBlock& points);

/// How the job's options and cap cut tiles.
TilingOptions surface_tiling(const JobState& state, const FieldOptions& field);
/// Memory that one tile may take.
std::uint64_t tile_bytes_limit(const RunOptions& run);

/// What a task of the surface stage takes beside the bytes of the tile that it computes. \param fused  with the first pass
/// \param near_bytes  of the multipoles around, where holes are closed
std::uint64_t surface_extra_bytes(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                                  const Tile& tile, int halo_cells, bool fused, std::uint64_t near_bytes);

/// The field of a job: radius and noise from the plan, angle from the options.
FieldOptions field_options(const Plan& plan, double feature_angle_deg);

/// What the extractor is asked for. \param names  vertices carry the keys by which patches weld
ExtractOptions extract_options(const ReconstructOptions& options, bool names);

/// Computes the band of every tile of a work directory that is ordered and oriented, one after the other, in tile
/// order, with tiles of two bricks.
void for_each_band(const std::filesystem::path& work, double feature_angle_deg,
                   const std::function<void(DirectedField&&)>& sink);

std::unique_ptr<Stage> make_surface_stage(const JobState& state);
StageForecast forecast_surface(const PlannedScan& scan);
/// Microseconds a face. Noisy samples are fitted again with wider radii, and look for sheets and creases that noise only feigns.
/// Where a surface model may stand in for crowns, a noise of a quarter of a cell and more is mostly theirs, and goes with them.
double surface_face_time(const PlannedScan& scan);

}  // namespace tessera
