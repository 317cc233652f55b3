/// \file tileset_stage.h
/// The last stage of a site: tileset.json, which gets its name when everything that it refers to has its own.
#pragma once
#include <cstdint>
#include <memory>

#include "stream/runtime/stage.h"

namespace tessera {

/// What its end takes. \param tiles  of all levels
std::uint64_t tileset_bytes(std::uint64_t tiles);

/// Stage "tileset" without tasks.
std::unique_ptr<Stage> make_tileset_stage(const JobState& state);

}  // namespace tessera
