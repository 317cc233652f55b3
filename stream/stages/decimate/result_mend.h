/// \file result_mend.h
/// Behind the passes of a round: what the blocks could not see, faces that came to cross at their sides, is mended before the
/// proof (crossing_stages.h), so that the proof holds for what is written. Where a mending leaves the tolerance the proof
/// fails there, and the next round leaves the mesh as it is around it, as around pairs that stay; the last round mends nothing, and
/// tells of pairs.
#pragma once
#include <string>
#include <vector>

#include "stream/stages/crossings/crossing_stages.h"
#include "stream/stages/decimate/simplify_stage.h"

namespace tessera {

/// \param tolerance  of the job, once it is known; 0 = none \param rounds  that there may be
CrossingPlan result_mend(const SimplifyStores& stores,
                         const std::function<double(const JobState&)>& tolerance, int passes, int round,
                         int rounds);
/// Of the faces that a round left crossing, relative to the work directory; not there without any.
std::string left_faces_file(int round);
/// What a round left in the end.
MeshStore open_round_result(const JobState& state, int passes, int round);
/// Of both stages in `reconstruct`. \param stage  its name
StageForecast forecast_mend(const PlannedScan& scan, const std::string& stage);

/// The same stores over the mended mesh.
SimplifyStores mended_stores(const CrossingPlan& plan);

/// The report's `crossings`: {input, result} of mending_of(), as far as there are; null without.
Json mendings_of(const Json& report, int rounds);

}  // namespace tessera
