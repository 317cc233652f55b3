#include "stream/stages/scan/orient_needs.h"

#include <algorithm>
#include <cmath>

#include "stream/stages/scan/normals_stage.h"
#include "stream/stages/scan/orient_solution.h"

namespace tessera {
namespace {

// Per occupied block of 8^3 cells; all but the boundary grow with the noise, up to a tenth of a cell: what the noisiest of six
// scans had, from simulated terrain to field scans of trees.
constexpr double kBlockBoundary = 7.0;  // surfels at the faces of the brick
constexpr double kBlockPatches = 6.0;
constexpr double kBlockVotes = 25.0;
constexpr double kBlockCoarse = 6.0;  // and one and a half without noise
constexpr double kMaxNoise = 0.1;
// Patches of the largest block that is oriented by itself, and of all patches those that are linked to other blocks.
constexpr std::uint64_t kBlockLimit = 1 << 16;
constexpr double kBorderPatches = 0.05;
constexpr double kBorderVotes = 5.0;
constexpr double kBorderLinks = 2.5;  // to other blocks

std::uint64_t rounded_up(double value) {
  return static_cast<std::uint64_t>(std::ceil(value));
}

}  // namespace

OrientNeeds orient_needs(const PlannedScan& scan) {
  const std::uint64_t bricks = scan.bricks.size();
  const double noise = std::min(1.0, scan.plan.noise_cells / kMaxNoise);
  const auto occupied = static_cast<double>(scan.blocks);
  const double patches = static_cast<double>(bricks) + occupied * noise * kBlockPatches;
  const double votes = occupied * noise * kBlockVotes, coarse = occupied * (1.5 + noise * kBlockCoarse);
  const double largest = std::min<double>(patches, kBlockLimit);
  const double part = patches > 0.0 ? largest / patches : 0.0;  // of the job, in that block
  const double border = (patches - largest) * kBorderPatches;
  const std::uint64_t border_votes = rounded_up(border * kBorderVotes);
  OrientNeeds needs;
  needs.links_task = links_task_bytes(rounded_up(static_cast<double>(scan.max_blocks) * kBlockBoundary),
                                      rounded_up(largest));
  needs.links_finish =
      links_finish_bytes(bricks, border_votes, rounded_up(coarse * part), rounded_up(largest));
  if (!scan.knows_sides && !scan.oriented_in_blocks)  // surfels may have to tell
    needs.links_finish =
        std::max(needs.links_finish,
                 look_around_bytes(rounded_up(coarse), rounded_up(coarse * part), rounded_up(largest),
                                   rounded_up(border * kBorderLinks), bricks, scan.run.memory_bytes));
  needs.links_disk = rounded_up(votes) * sizeof(PatchVote) + rounded_up(patches) * sizeof(PatchGroup);
  needs.task = solve_block_bytes(rounded_up(largest), rounded_up(votes * part), rounded_up(coarse * part));
  needs.finish =
      block_orientation_bytes(rounded_up(patches), rounded_up(largest), rounded_up(border), 2 * border_votes);
  if (!scan.knows_sides && !scan.oriented_in_blocks)
    needs.finish = std::max(needs.finish,
                            settle_doubt_bytes(rounded_up(patches), rounded_up(largest), rounded_up(coarse),
                                               rounded_up(coarse * part), bricks, scan.run.memory_bytes));
  return needs;
}

}  // namespace tessera
