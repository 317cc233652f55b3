/// \file dense_bricks.h
/// Tiles of one brick around which too many points lie for the cap: their field is evaluated in parts, each with its halo, to
/// the same bits.
#pragma once
#include <cstdint>
#include <span>

#include "kernels/field/directed_field.h"
#include "kernels/field/field.h"
#include "stream/points/closing_store.h"
#include "stream/points/point_store.h"
#include "stream/runtime/stage.h"
#include "stream/stages/plan/tile.h"

namespace tessera {

/// How a tile is computed.
struct TileCut {
  int edge = 0;             ///< of its parts, cells; 0: at once
  std::uint64_t bytes = 0;  ///< of memory, as tile_bytes() tells them
};

/// The largest parts that leave room for the rest within the limit, from the tables of blocks of the bricks around.
/// \param halo_cells  within which the points of a part are loaded
TileCut cut_tile(const PointStore& store, const BrickSectionStore* closing, const Tile& tile, int halo_cells,
                 std::uint64_t bytes_limit);

/// Memory of the tile before there are such tables: of points around the brick a share as if they lay evenly, twice.
std::uint64_t expected_tile_bytes(std::span<const BrickEntry> bricks, const BrickSectionStore* closing,
                                  const Tile& tile, int halo_cells, std::uint64_t bytes_limit);

/// The field of a tile without closing cells, part by part. \returns no leaves where no point is
/// \param edge  of the parts, cells; 0: at once
/// \param own_points  is raised by the points of the tile
/// \param context  is told what was read
DirectedField field_in_parts(const PointStore& store, const Tile& tile, int edge, const FieldOptions& options,
                             std::uint64_t& own_points, TaskContext& context);

}  // namespace tessera
