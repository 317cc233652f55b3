/// \file orient_solution.h
/// One sign per patch, and who decided it. Where patches know their sides (scenes seen from above, own sensors) blocks of
/// them are solved one by one, and what they leave to each other at the end; else what surfels of the whole job see of each
/// other decides, in one piece.
#pragma once
#include <cstdint>

#include "stream/files/json.h"
#include "stream/points/patch_blocks.h"
#include "stream/points/point_overlay.h"
#include "stream/runtime/stage.h"
#include "stream/stages/scan/orient_viewers.h"

namespace tessera {

/// Bytes that solve_whole_orientation holds at most. \param patches, coarse  patches and coarse surfels of all bricks
/// \param votes  between patches, of one brick or of two
std::uint64_t whole_orientation_bytes(std::uint64_t patches, std::uint64_t votes, std::uint64_t coarse);

/// Fills decisions.patch. Entry gets what OrientationTally tells, frustrated_fraction, and where nobody was known to see,
/// scene with what told it (enclosed_fraction, shell_fraction, density_spread: visibility.h).
void solve_whole_orientation(const PointOverlay& overlay, const PatchLinks& links, const Viewers& viewers,
                             const TaskContext& context, OverlayDecisions& decisions, Json& entry);

/// What one block can decide by itself.
/// \param tops  of the whole scene, where that is seen from above
BlockSigns solve_block(const PointOverlay& overlay, const PatchLinks& links, std::size_t index,
                       const PatchBlock& block, const OrientationScene& scene, const TopColumns& tops,
                       const Viewers& viewers);
std::uint64_t solve_block_bytes(std::uint64_t patches, std::uint64_t votes, std::uint64_t coarse);

/// The anchors of all blocks, then every patch. \param anchors  of list_patch_blocks(overlay), solve_block's
void solve_block_orientation(const PointOverlay& overlay, const PatchLinks& links,
                             const OrientationScene& scene, const PatchAnchors& anchors,
                             const Viewers& viewers, const TaskContext& context, OverlayDecisions& decisions,
                             Json& entry);
/// \param patches  of the job \param largest  of its largest block \param border  with links to other blocks
/// \param votes  between anchors
std::uint64_t block_orientation_bytes(std::uint64_t patches, std::uint64_t largest, std::uint64_t border,
                                      std::uint64_t votes);

}  // namespace tessera
