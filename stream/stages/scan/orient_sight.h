/// \file orient_sight.h
/// What surfels of the whole job see of each other, or sensors of them, for scans whose patches do not know their sides and
/// that were not seen from above: votes of every block, found from a part of the scan at a time.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/points/visibility.h"
#include "stream/files/json.h"
#include "stream/files/packed_file.h"
#include "stream/points/patch_blocks.h"
#include "stream/runtime/stage.h"
#include "stream/stages/scan/orient_viewers.h"

namespace tessera {

/// Left in the work directory by the pass "orient" where the scan shows rooms.
inline constexpr const char* kRoomFile = "room.json";

/// Votes of what is seen, by block.
class SightVotes {
 public:
  static constexpr const char* kFile = "links/sight.bin";

  explicit SightVotes(const std::filesystem::path& path);
  /// Of the block's groups, numbered inside it; of sensors: of its patches. `b` does not matter.
  std::vector<PatchVote> sides(std::size_t block) const;
  std::vector<PatchVote> pairs(std::size_t block) const;  ///< between two groups of the block
  std::vector<PatchVote> outer() const;  ///< between patches of two blocks, numbered over all bricks
  std::uint64_t outer_count() const { return table_.back().pairs.bytes / sizeof(PatchVote); }
  bool is_room() const { return facts_.scene == SceneKind::kRoom; }
  double sight() const { return facts_.sight; }  ///< VisibilityVotes::sight
  /// Scene, and what told it.
  void tell(Json& entry) const;

 private:
  friend void look_around(const PointOverlay&, const std::vector<PatchBlock>&, const PatchLinks&,
                          const Viewers&, std::uint64_t, const TaskContext&, const std::filesystem::path&);
  struct Facts {
    double enclosed = 0.0, shells = 0.0, density_spread = 0.0, facing = 0.0, sight = 0.0;
    SceneKind scene = SceneKind::kLand;
    std::uint8_t by_sensors = 0;
    std::array<std::uint8_t, 6> unused{};
  };
  struct Entry {
    Section sides, pairs;  ///< of a block; the last entry: those between blocks
  };
  PackedFile file_;
  std::vector<Entry> table_;
  Facts facts_;
};

/// Writes them. \param memory  of the job
void look_around(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks, const PatchLinks& links,
                 const Viewers& viewers, std::uint64_t memory, const TaskContext& context,
                 const std::filesystem::path& file);
/// What groups in doubt see when all of them look: per patch over all bricks, the lean of its group for the side that the
/// patch's surfels show. \param asked  per patch: whether its group is in doubt
/// \pre the scene is a room
std::vector<float> look_again(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks,
                              const PatchLinks& links, const Viewers& viewers, const SightVotes& sight,
                              const std::vector<std::uint8_t>& asked, std::uint64_t memory,
                              const TaskContext& context);
std::uint64_t look_again_bytes(std::uint64_t coarse, std::uint64_t largest, std::uint64_t patches,
                               std::uint64_t bricks, std::uint64_t memory);
/// Bytes that it holds at most. \param coarse  surfels \param largest  of the block that has most
/// \param patches  of the largest block \param outer  links between blocks
std::uint64_t look_around_bytes(std::uint64_t coarse, std::uint64_t largest, std::uint64_t patches,
                                std::uint64_t outer, std::uint64_t bricks, std::uint64_t memory);

}  // namespace tessera
