/// \file samples_stage.h
/// Pass "samples" of `reconstruct --reference points`: the distance of every point that the job used to the result,
/// one way.
#pragma once
#include <functional>
#include <memory>

#include "stream/mesh_store.h"
#include "stream/stage.h"

namespace tessera {

struct SamplesRequest {
  double tolerance = 0.0;  ///< scan units, > 0
  std::function<MeshStore(const JobState&)> mesh;
};

/// Its finish reports count, largest distance with its place (rounding on the safe side), RMS and histogram.
/// \throws ValidationError from finish when a point is farther than the tolerance
std::unique_ptr<Stage> make_samples_stage(const JobState& state, const SamplesRequest& request);

}  // namespace tessera
