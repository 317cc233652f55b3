/// \file store_write_stage.h
/// The stage that turns a mesh store into a mesh file: the last one of most jobs over stores.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Stage "write" without tasks: its finish streams `store` to the job's output, with one comment.
/// \param sort_bytes  memory of its sorts (MeshStoreOutput::memory_bytes): as a rule sort_bytes()
std::unique_ptr<Stage> make_store_write_stage(const JobState& state, MeshStore store, std::string comment,
                                              std::uint64_t sort_bytes);

/// What the sorts of a stage may take under the job's cap.
std::uint64_t sort_bytes(const RunOptions& run);

/// Stage "keep-raw", the same with the name of raw_output_path().
std::unique_ptr<Stage> make_keep_raw_stage(const JobState& state, MeshStore store, std::string comment,
                                           std::uint64_t sort_bytes);
/// Beside the output: "site.raw.ply" for "site.ply".
std::filesystem::path raw_output_path(const std::filesystem::path& output);

}  // namespace tessera
