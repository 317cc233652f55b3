/// \file patch_groups.h
/// Groups of patches whose links leave little doubt of their relative signs: what is known of a scene decides the sides of
/// groups where it says too little of a patch.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/points/sign_solver.h"

namespace tessera {

struct PatchGroups {
  std::vector<std::uint32_t> of;    ///< per patch
  std::vector<std::int8_t> sign;    ///< of a patch in its group
  std::vector<std::uint64_t> size;  ///< of a group, weight of its patches
  [[nodiscard]] std::uint32_t count() const { return static_cast<std::uint32_t>(size.size()); }
};

/// \pre links are merged, a < b
[[nodiscard]] PatchGroups group_patches(std::span<const std::uint64_t> weight,
                                        const std::vector<PatchVote>& links, const ContractionLimits& limits);

/// Patches that know their side by themselves and clearly show another one than their group leave it, each as a group of its
/// own: seen from above, a roof that links joined to the ground the wrong way round.
/// \param sides  of patches, in the signs of their groups; `b` does not matter
/// \param clear  share of a patch's votes that makes it leave
void tear_groups(std::span<const PatchVote> sides, std::span<const std::uint64_t> weight, double clear,
                 PatchGroups& groups);

}  // namespace tessera
