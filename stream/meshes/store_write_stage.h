/// \file store_write_stage.h
/// The stage that turns a mesh store into a mesh file: the last one of most jobs over stores.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/job.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Stage "write" without tasks: its finish streams `store` to the job's output, with one comment.
/// \param sort_bytes  memory of its sorts (MeshStoreOutput::memory_bytes): as a rule sort_bytes()
/// \param placement   where the file's positions count from, if a proof before it counts on that; else the store's own
std::unique_ptr<Stage> make_store_write_stage(const JobState& state, MeshStore store, std::string comment,
                                              std::uint64_t sort_bytes,
                                              const std::optional<MeshPlacement>& placement = {});

/// How a job's output holds a store; of a result by that of the mesh it is made of, grown by the tolerance.
/// \param tolerance  of the job, 0 where it has none
MeshPlacement store_placement(const std::filesystem::path& output, const MeshStore& store, double tolerance);

/// Adds to the result of a stage that wrote a mesh file what rounding to floats did, where anything: `origin`, `rounding`,
/// and sentences under `warnings`.
void tell_rounding(Json& result, const std::filesystem::path& output, const Double3& origin,
                   const MeshRounding& rounding);
/// What the file beside an STL says of the origin in such a result; empty without one.
std::string origin_text(const Json& result);
/// That file, which tells other programs (mesh_precision.h), from `mesh` of a job's report.
SidecarOutput known_origin();

/// What the sorts of a stage may take under the job's cap.
std::uint64_t sort_bytes(const RunOptions& run);

/// What the write stage takes, told before there is a mesh: for patches of some bytes (MeshStore::block_bytes()).
StageNeed store_write_need(const RunOptions& run, std::uint64_t patch_bytes, std::uint64_t patches,
                           std::uint64_t sort_bytes);

/// Stage "keep-raw", the same with the name of raw_output_path().
std::unique_ptr<Stage> make_keep_raw_stage(const JobState& state, MeshStore store, std::string comment,
                                           std::uint64_t sort_bytes);
/// Beside the output: "site.raw.ply" for "site.ply".
std::filesystem::path raw_output_path(const std::filesystem::path& output);

}  // namespace tessera
