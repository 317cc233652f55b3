/// \file orient_anchors.h
/// The signs of the anchors that blocks of patches leave open: cubes of blocks are contracted as blocks were, and one graph of
/// what is linked across cubes is solved at the end.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/points/block_signs.h"
#include "stream/points/patch_blocks.h"
#include "stream/runtime/stage.h"
#include "stream/stages/scan/orient_sight.h"

namespace tessera {

class AnchorSigns {
 public:
  /// Of a cube of more than one block. Scans of fewer are solved as one graph.
  static constexpr std::uint64_t kMaxAnchors = 1u << 17;

  /// \param sight  null where patches know their sides \param limit  as kMaxAnchors
  AnchorSigns(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks, const PatchLinks& links,
              const OrientationScene& scene, const PatchAnchors& anchors, const SightVotes* sight,
              const TaskContext& context, std::uint64_t limit = kMaxAnchors);

  struct Known {
    int sign = 1;
    bool uncertain = false;
    std::uint64_t component = 0;  ///< 0: hangs together with what is known
  };
  /// What a patch of a block hangs on.
  Known of(std::size_t block, const PatchAnchor& patch) const;
  /// Share of the links of all patches that the signs break.
  double frustrated() const { return frustrated_; }
  std::size_t cubes() const { return cubes_.size(); }

  /// Bytes at most. \param border  patches with links to other blocks \param votes  between anchors
  static std::uint64_t bytes(std::uint64_t border, std::uint64_t votes);

 private:
  struct Cube {
    std::size_t first_block = 0, last_block = 0;
    std::uint32_t first_top = 0;       ///< its anchors in the last graph
    std::vector<PatchAnchor> anchors;  ///< of its blocks: what they hang on
  };
  struct Port {
    std::uint32_t top = 0;
    std::int8_t sign = 0;  ///< 0: no link leaves its cube
  };
  void list_cubes(const PointOverlay& overlay, const std::vector<PatchBlock>& blocks,
                  const PatchAnchors& anchors, std::uint64_t limit);
  std::size_t cube_of(std::uint32_t patch) const;
  BlockSigns solve_cube(const Cube& cube, const std::vector<PatchBlock>& blocks, const PatchLinks& links,
                        const OrientationScene& scene, const PatchAnchors& anchors,
                        const std::vector<PatchVote>& seen);
  Known of_top(std::uint32_t top) const;

  std::vector<Cube> cubes_;
  std::vector<std::uint64_t> first_patch_;  ///< of every cube, and the end
  std::vector<std::uint64_t> block_patch_;  ///< first of every block
  std::vector<std::size_t> cube_of_block_;
  std::vector<std::uint32_t> first_anchor_;  ///< of every block in its cube
  std::vector<Port> ports_;                  ///< per patch of scene.border
  SignSolution top_;
  std::uint32_t outside_ = 0;
  double frustrated_ = 0.0;
};

}  // namespace tessera
