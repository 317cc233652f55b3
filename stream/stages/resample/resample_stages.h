/// \file resample_stages.h
/// Stages of resampling, after those of import.
///
///   scale   the median edge, the tolerance
///   bends   blocks with a halo of the search radius: vertices in bands; then their tracks
///   blends  one task a blend, over the bricks around it; then which of them stand: two that touch do not both
///   apply   patches with faces that go or come, written anew
#pragma once
#include <memory>

#include "stream/runtime/stage.h"
#include "stream/stages/resample/resample_files.h"
#include "stream/stages/resample/resample_options.h"

namespace tessera {

/// Numbers of the blends whose change is taken over.
std::vector<std::size_t> blends_that_stand(const std::filesystem::path& work);
/// The imported mesh with its patches that resampling changed.
MeshStore open_resampled(const std::filesystem::path& work);

std::unique_ptr<Stage> make_resample_scale_stage(const JobState& state, const ResampleOptions& options);
std::unique_ptr<Stage> make_curvatures_stage(const JobState& state, const ResampleOptions& options);
std::unique_ptr<Stage> make_blends_stage(const JobState& state, const ResampleOptions& options);
std::unique_ptr<Stage> make_resample_apply_stage(const JobState& state);

/// What a block of the search takes. \param block_bytes  MeshStore::block_bytes of it and its halo
std::uint64_t curvatures_task_bytes(std::uint64_t block_bytes, std::uint64_t vertices, std::uint64_t faces);

/// Of the scale; of a blend in a block; of a patch with the blends that change it, bytes of their files.
std::uint64_t resample_scale_bytes(std::uint64_t patch_bytes);
std::uint64_t blends_task_bytes(std::uint64_t block_bytes, std::uint64_t vertices, std::uint64_t faces);
std::uint64_t resample_apply_bytes(std::uint64_t patch_bytes, std::uint64_t blend_bytes,
                                   std::uint64_t largest_blend);

}  // namespace tessera
