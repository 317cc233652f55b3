/// \file tileset_stage.h
/// The last stage of a site: tileset.json, which gets its name when everything that it refers to has its own.
#pragma once
#include <memory>

#include "stream/runtime/stage.h"

namespace tessera {

/// Stage "tileset" without tasks.
std::unique_ptr<Stage> make_tileset_stage(const JobState& state);

}  // namespace tessera
