/// \file weld_stages.h
/// Patches of the surface become one mesh: joined, their border made smooth, holes filled; for jobs that go on with it, written
/// and read again as a store.
#pragma once
#include <functional>
#include <vector>

#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stage.h"
#include "stream/stages/decimate/simplify_stage.h"

namespace tessera {

/// They stand behind the stage "surface" where that leaves patches (ReconstructOptions::fuses_stores).
std::vector<StageEntry> weld_stages(const ReconstructOptions& options);
/// With --reference points, before decimation. \param full  the mesh of full resolution
StageEntry points_stage(const std::function<MeshStore(const JobState&)>& full);
/// The store of the mesh, with a tolerance. \pre the stages are done
SimplifyStores welded_stores();

}  // namespace tessera
