/// \file scan_colours.h
/// Colours of textures from the scans of a reconstruction, read once more as its survey read them.
#pragma once
#include <memory>

#include "stream/stages/bake/bake_colours.h"

namespace tessera {

/// The points that were wanted, in the colours of `--colour`. \throws as open_packed_inputs()
std::unique_ptr<BakeColours> colours_of_job(const JobState& state);

/// \throws InputError where the scans have nothing that `--colour` could show
void require_colours(const JobState& state);

}  // namespace tessera
