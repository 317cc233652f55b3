/// \file grid_stage.h
/// Chooses the one grid on which the tiles of a level have their positions.
#pragma once
#include <memory>

#include "stream/runtime/stage.h"
#include "stream/stages/tiles/tiles_options.h"

namespace tessera {

/// Stage "grid" in the folder of a level: counts the faces of tiles that meet by a grid of which 16 bits are enough for most.
std::unique_ptr<Stage> make_grid_stage(const JobState& state, const TilesOptions& options, int level);
/// Stage "finer-grid": where some meet, counts them on every grid that is finer by a power of two, as far as all tiles fit
/// the 24 bits of a float, and chooses the coarsest of those with the fewest. Idle where none do. \pre stage "grid" is done
std::unique_ptr<Stage> make_finer_grid_stage(const JobState& state, const TilesOptions& options, int level);

}  // namespace tessera
