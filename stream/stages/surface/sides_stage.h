/// \file sides_stage.h
/// Pass "sides", the twin of "uncross" (stages/weld/uncross_stage.h) for stores of blocks (first_pass.h): where faces cross at the sides of
/// blocks, which no block sees whole, the vertices that features and borders moved go back. In each round all that may go back
/// of two faces that cross do; the last round only looks, and says which blocks have such vertices: the pass "prune" moves them
/// there and decimates those blocks anew.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/mesh/uncross_block.h"
#include "stream/runtime/stage.h"

namespace tessera {

inline constexpr int kSideRounds = 3;

/// A stage for each round, to stand behind "surface".
std::vector<StageEntry> side_stages();

/// Vertices that went back in the rounds before this one, keys ascending; positions as the store has them.
std::vector<SafePlace> load_side_moves(const std::filesystem::path& work, int rounds = kSideRounds);

/// A block in which some of them are.
struct MovedBlock {
  std::uint64_t file = 0;   ///< task of the surface stage
  std::uint64_t brick = 0;  ///< first one, Morton code
  std::uint64_t bricks = 0;
};
/// All of them, ascending by file, then brick.
std::vector<MovedBlock> load_moved_blocks(const std::filesystem::path& work);

/// Folders of the rounds and what they read, for who needs them last.
std::vector<std::string> side_folders();

}  // namespace tessera
