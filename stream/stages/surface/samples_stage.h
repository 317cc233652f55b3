/// \file samples_stage.h
/// Passes "points" and "samples" of `reconstruct --reference points`: the distance of every point that the job used to
/// the surface of full resolution, before decimation, and to the result, one way.
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct SamplesRequest {
  double tolerance = 0.0;  ///< scan units, > 0
  std::function<MeshStore(const JobState&)> mesh;
  bool before = false;  ///< stage "points": what the points leave of the tolerance is kept for the passes
};

/// What a task takes at most. \param block_bytes, faces  MeshStore::block_bytes and faces near its largest brick
std::uint64_t samples_task_bytes(std::uint64_t brick_points, std::uint64_t block_bytes, std::uint64_t faces);

/// Its finish reports count, largest distance with its place (rounding on the safe side), RMS and histogram.
/// \throws ValidationError from finish when a point is farther than the tolerance; `before`: when less than a 64th of
///         it is left, naming the least tolerance that can do
std::unique_ptr<Stage> make_samples_stage(const JobState& state, const SamplesRequest& request);
/// \param before  of the stage "points"
StageForecast forecast_samples(const PlannedScan& scan, bool before);

/// What stage "points" found left of the tolerance: a mesh within it of the surface is within the tolerance of every
/// point. \pre the stage is done
double tolerance_left(const std::filesystem::path& work);

}  // namespace tessera
