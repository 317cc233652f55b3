/// \file coverage_stage.h
/// Pass "coverage": how much of what the scan saw is in the mesh, in two figures.
///   plan       of the columns, squares of four spacings seen from above, that hold at least four points: the share that
///              the mesh covers with a corner or over their middle
///   confirmed  of a sample of the points that lie on a surface beyond doubt: the share within two spacings of the mesh
/// Leaves, spray and noise count in neither: a mesh may rightly leave them out. Both are counts over unions and sums that hang
/// on no order, so they are the same for all tiles, caps, threads and orders of the input.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>

#include "stream/runtime/stage.h"
#include "stream/stages/coverage/face_source.h"

namespace tessera {

/// \param faces_bytes  of its source of faces  \param patch_vertices  of the largest part
std::uint64_t coverage_task_bytes(std::uint64_t faces_bytes);
std::uint64_t coverage_finish_bytes();

/// Its finish returns both figures with their counts and draws OUT.missing.png where anything is missing.
/// \param faces  called once the passes before it are done
std::unique_ptr<Stage> make_coverage_stage(
    const JobState& state, const std::function<std::unique_ptr<FaceSource>(const JobState&)>& faces);
StageForecast forecast_coverage(const PlannedScan& scan);

}  // namespace tessera
