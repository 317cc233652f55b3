/// \file write_stage.h
/// Pass "write": streams the kept patches into the output file with one global numbering.
#pragma once
#include <span>

#include "stream/meshes/patch_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// What writing takes at most. \param filling_bytes  of the largest batch of fillings
std::uint64_t write_bytes(std::span<const PatchEntry> patches, std::uint64_t filling_bytes);

std::unique_ptr<Stage> make_write_stage(const JobState& state);
StageForecast forecast_write(const PlannedScan& scan);  ///< and of the raw mesh
/// The same for patches that are not of a reconstruction. \param maker  of the file's comment: "tessera resurface"
std::unique_ptr<Stage> make_write_stage_of(const JobState& state, const std::string& maker);

/// For jobs that go on with the mesh: the same into kRawMeshFile of the work directory.
inline constexpr const char* kRawMeshFile = "raw/mesh.ply";
std::unique_ptr<Stage> make_raw_write_stage(const JobState& state);

}  // namespace tessera
