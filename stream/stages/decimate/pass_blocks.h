/// \file pass_blocks.h
/// What a pass over shifted blocks works on, whatever it does to them: the blocks, dealt to tasks; the mesh of full
/// resolution; the places where earlier rounds failed; and the same pass of the round before, which unchanged blocks are taken
/// from.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "stream/files/json.h"
#include "stream/meshes/failed_regions.h"
#include "stream/stages/decimate/round_before.h"
#include "stream/stages/decimate/simplify_stage.h"

namespace tessera {

class PassBlocks {
 public:
  struct Rules {
    double tolerance = 0.0;  ///< of the job, scan units; 0 = none
    double failed_radius =
        0.0;  ///< around what failed a round ago; four times as wide around what failed before that
    std::uint64_t task_faces = 0;  ///< of blocks and their weights, from which on a task is worth a file
    std::function<std::vector<MeshBlockCut>(const MeshStore& in, const MeshStore& reference)> cut;
    int first_round =
        0;  ///< nothing is taken from rounds before this one, and where they failed says nothing
  };
  /// \throws InputError when what an earlier stage left is damaged; what require_provable() throws
  PassBlocks(const JobState& state, const SimplifyStores& stores, const SimplifyPass& pass,
             const Rules& rules);

  const MeshStore& in() const { return in_; }
  const MeshStore& reference() const { return reference_; }
  std::size_t task_count() const { return first_.size() - 1; }
  std::size_t first(std::size_t task) const { return first_[task]; }
  std::size_t end(std::size_t task) const { return first_[task + 1]; }
  const MeshBlockCut& operator[](std::size_t block) const { return blocks_[block]; }

  /// Where nothing has changed since the round before, writes what that left.
  /// \param sum  gets its counts \param left  if not null, gets what was written \returns whether it did
  bool copy_unchanged(const MeshBlockCut& cut, MeshFileWriter* writer, Json& sum, TaskContext& context,
                      MeshBlock* left = nullptr) const;
  /// Keys of the vertices that stay, because earlier rounds failed near them; ascending.
  std::vector<std::uint64_t> pinned_keys(const MeshBlock& block, TaskContext& context) const;
  std::uint64_t failed_bytes() const { return failed_.bytes(); }
  /// Share of the tolerance that blocks with such vertices work at.
  double careful() const { return careful_; }

 private:
  MeshStore in_, reference_;
  std::vector<MeshBlockCut> blocks_;
  FailedRegions failed_;
  double careful_ = 1.0;
  std::optional<RoundBefore> before_;
  std::vector<std::size_t> first_;  ///< block index per task, one more at the end
};

}  // namespace tessera
