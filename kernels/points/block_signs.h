/// \file block_signs.h
/// Orientation out of core: what one block of patches can decide by itself. Patches that are linked to other blocks are
/// anchors, whose signs are left to a graph of the whole job; every other patch hangs on an anchor, on what is known of its
/// side, or on neither, with a sign that only votes inside the block speak of. Summing the votes of what hangs together
/// loses none, so the graph of the anchors is the whole one, contracted. Source: Schertler, Savchynskyy, Gumhold, "Towards
/// Globally Optimal Normal Orientations for Large Point Clouds", 2017 (reduced graphs).
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/points/patch_groups.h"
#include "kernels/points/sign_solver.h"

namespace tessera {

/// The patches of one block; all indices are inside it.
struct SignBlock {
  PatchGroups groups;
  std::vector<PatchVote> links;  ///< between its patches, merged, a < b
  std::vector<PatchVote>
      sides;  ///< of groups, for the side that they show; `b` does not matter, repeats add up
  std::vector<std::uint8_t> border;   ///< per patch: linked to a patch of another block, or seen by one
  std::vector<PatchVote> pairs = {};  ///< between groups that see each other, a < b
};

/// What a patch hangs on.
struct PatchAnchor {
  static constexpr std::uint32_t kOutside = 0xffffffffu;  ///< on its known side
  static constexpr std::uint32_t kLoose =
      0x80000000u;  ///< on nothing; the other bits: first patch of what hangs together

  std::uint32_t anchor = kOutside;  ///< index of an anchor of the block, kOutside, or kLoose and more
  std::int8_t sign = 1;             ///< relative to it; kOutside and loose patches have the sign 1
  std::uint8_t uncertain = 0;       ///< the votes that it hangs by were split
  std::int8_t shown = 0;            ///< the sign for which its group's sides speak, 0 = none
  std::uint8_t unused = 0;
};

struct BlockSigns {
  std::vector<PatchAnchor> patches;
  std::vector<std::uint64_t> weight;  ///< per anchor, summed over what hangs on it
  std::vector<PatchVote> links;       ///< between anchors, merged; `b` may be kOutside
  std::vector<PatchVote> sides;       ///< of anchors, `b` is kOutside, and pairs of them that see each other
  std::uint64_t broken_votes =
      0;  ///< weight of links between patches that hang on one anchor which their signs break
  std::uint64_t inner_votes = 0;  ///< and of all of these links
};

/// \pre links are merged, a < b; groups are numbered without gaps
[[nodiscard]] BlockSigns solve_block_signs(const SignBlock& block);

/// Least lean of what a group in doubt sees (GroupView) that settles it.
inline constexpr float kClearLook = 0.25f;

/// Settles groups in doubt that look again: those whose looks clearly speak for their sign, then what votes of settled ones
/// tell (decide_told). No sign changes: what looks speak against stays in doubt.
/// \param links  between the patches of a block \param sign  of its patches, final
/// \param lean  per patch: of its group, for the side that the final sign shows; 0 = nothing was seen
/// \param doubtful  per patch, all of a group alike
void settle_doubt(const PatchGroups& groups, std::span<const PatchVote> links,
                  std::span<const std::int8_t> sign, std::span<const float> lean,
                  std::span<std::uint8_t> doubtful);

}  // namespace tessera
