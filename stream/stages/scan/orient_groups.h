/// \file orient_groups.h
/// Groups of patches that go through several blocks, so that what is seen says as much of them as of groups inside a block.
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "kernels/points/visibility.h"
#include "stream/points/patch_blocks.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Groups of a block that links to other blocks join, with their signs: one group of the job.
struct SharedGroup {
  std::uint32_t group = 0;   ///< of its block, numbered over all
  std::uint32_t shared = 0;  ///< of the job
  std::int8_t sign = 1;      ///< in that
  std::uint64_t size = 0;    ///< surfels
};

/// What links between blocks, and those inside that speak of the same groups, join.
class JobGroups {
 public:
  JobGroups(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks, const PatchLinks& links,
            const TaskContext& context);
  /// Bytes that it takes at most while it is made, and then. \param outer  links between blocks
  static std::uint64_t bytes(std::uint64_t outer);
  static std::uint64_t held_bytes(std::uint64_t outer) { return 2 * outer * (sizeof(SharedGroup) + 12); }

  std::uint32_t first_shared() const { return first_shared_; }
  std::uint32_t count() const { return static_cast<std::uint32_t>(size_.size()); }
  /// Null where no link leaves the block. \param group  numbered over all blocks
  const SharedGroup* find(std::uint32_t group) const;
  /// Turns votes of groups of the job into votes of those of blocks, with votes that no other outweighs for what was joined.
  void share_out(VisibilityVotes& votes) const;

 private:
  std::vector<std::uint32_t>::const_iterator first_of(std::uint32_t shared) const;
  std::pair<std::uint32_t, std::int8_t> of_block(std::uint32_t group) const;

  std::vector<SharedGroup> groups_;       ///< ascending group
  std::vector<std::uint32_t> by_shared_;  ///< ascending shared, then group
  std::vector<std::uint64_t> size_;       ///< of shared groups
  std::uint32_t first_shared_ = 0;
};

}  // namespace tessera
