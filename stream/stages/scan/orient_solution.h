/// \file orient_solution.h
/// One sign per patch, and who decided it: blocks of patches are solved one by one, and what they leave to each other at the
/// end.
#pragma once
#include <cstdint>

#include "stream/files/json.h"
#include "stream/points/patch_blocks.h"
#include "stream/points/point_overlay.h"
#include "stream/runtime/stage.h"
#include "stream/stages/scan/orient_sight.h"
#include "stream/stages/scan/orient_viewers.h"

namespace tessera {

/// What one block can decide by itself.
/// \param tops  of the whole scene, where that is seen from above \param sight  where surfels or sensors have told; else null
BlockSigns solve_block(const PointOverlay& overlay, const PatchLinks& links, std::size_t index,
                       const PatchBlock& block, const OrientationScene& scene, const TopColumns& tops,
                       const SightVotes* sight, const Viewers& viewers);
std::uint64_t solve_block_bytes(std::uint64_t patches, std::uint64_t votes, std::uint64_t coarse);

/// The anchors of all blocks, then every patch; then what is in doubt looks again. Fills decisions.patch. Entry gets what
/// OrientationTally tells, frustrated_fraction, anchors. \param anchors  of list_patch_blocks(overlay), solve_block's
/// \param memory  of the job \pre decisions tell what becomes of strewn points and outliers
void solve_block_orientation(const PointOverlay& overlay, const PatchLinks& links,
                             const OrientationScene& scene, const PatchAnchors& anchors,
                             const SightVotes* sight, const Viewers& viewers, std::uint64_t memory,
                             const TaskContext& context, OverlayDecisions& decisions, Json& entry);
/// \param patches  of the job \param largest  of its largest block \param border  with links to other blocks
/// \param votes  between anchors
std::uint64_t block_orientation_bytes(std::uint64_t patches, std::uint64_t largest, std::uint64_t border,
                                      std::uint64_t votes);
/// Of what is in doubt looking again. \param largest, surfels  patches and coarse surfels of the largest block
std::uint64_t settle_doubt_bytes(std::uint64_t patches, std::uint64_t largest, std::uint64_t coarse,
                                 std::uint64_t surfels, std::uint64_t bricks, std::uint64_t memory);

}  // namespace tessera
