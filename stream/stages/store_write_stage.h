/// \file store_write_stage.h
/// The last stage of a job over a mesh store: the store becomes the output file.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "stream/mesh_store.h"
#include "stream/stage.h"

namespace tessera {

/// Stage "write" without tasks: its finish streams `store` to the job's output, with one comment.
/// \param sort_bytes  memory of its sorts (MeshStoreOutput::memory_bytes)
std::unique_ptr<Stage> make_store_write_stage(const JobState& state, MeshStore store, std::string comment,
                                              std::uint64_t sort_bytes);

}  // namespace tessera
