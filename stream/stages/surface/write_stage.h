/// \file write_stage.h
/// Pass "write": streams the kept patches into the output file with one global numbering.
#pragma once
#include "stream/runtime/stage.h"

namespace tessera {

std::unique_ptr<Stage> make_write_stage(const JobState& state);

/// For jobs that go on with the mesh: the same into kRawMeshFile of the work directory.
inline constexpr const char* kRawMeshFile = "raw/mesh.ply";
std::unique_ptr<Stage> make_raw_write_stage(const JobState& state);

}  // namespace tessera
