/// \file block_sides.h
/// What the blocks of the first pass (first_pass.h) keep of their sides for the pass "sides", which sees what they could not: faces
/// that cross those of another block. Per block: its faces that come within two cells of a side, and where vertices that were
/// moved there may go back to.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "kernels/mesh/patch_mesh.h"
#include "kernels/mesh/risky_crossings.h"
#include "stream/files/packed_file.h"

namespace tessera {

inline constexpr const char* kSideFolder = "block-sides/";

/// A block of one file.
struct SideEntry {
  std::uint64_t brick = 0;   ///< first one, Morton code
  std::uint32_t bricks = 0;  ///< 1, 8 or 64
  std::uint32_t vertices = 0, faces = 0, places = 0;
  std::array<std::uint32_t, 6> faces_at = {};  ///< of them at each side: low x, high x, low y, ...
  Section content;                             ///< keys, positions, safe places, faces
};

/// Writes those of one task of the surface stage.
class SideFileWriter {
 public:
  SideFileWriter(const std::filesystem::path& path, const MeshFrame& frame);
  /// \param block  with all of its faces \param safe  of its bricks, keys ascending; what lies there already is left out
  /// \pre cells of one size; blocks in ascending order
  void add(std::uint64_t brick, std::uint32_t bricks, const MeshBlock& block,
           std::span<const SafePlace> safe);
  std::uint64_t finish();  ///< returns bytes written

 private:
  std::array<double, 4> frame_;  ///< min corner of brick 0, edge of a cell
  PackedWriter file_;
  std::vector<SideEntry> table_;
};
/// \returns name below the work directory
std::string side_file(std::size_t task);

/// What lies at the sides of one block, and of others around it.
struct SideMesh {
  RiskyMesh mesh;  ///< no vertex is risky yet; a vertex stands once for each block that has it
  std::size_t own_vertices = 0, own_faces = 0;  ///< of the block itself: they come first
  std::vector<SafePlace>
      safe;  ///< of its vertices, keys ascending: where those that lie elsewhere may go back to
};

/// All of them. Loading is thread-safe.
class BlockSides {
 public:
  explicit BlockSides(const std::filesystem::path& work);

  std::size_t block_count() const { return entries_.size(); }
  std::size_t file_count() const { return first_.size() - 1; }
  std::size_t first(std::size_t file) const { return first_[file]; }
  std::size_t end(std::size_t file) const { return first_[file + 1]; }
  const SideEntry& operator[](std::size_t block) const { return entries_[block]; }
  /// Codes of the bricks of a block and of those that touch it.
  std::vector<std::uint64_t> bricks_around(std::size_t block) const;
  /// The faces of a block, and those near them of the blocks behind it in order: what it shares with one before it is looked at there.
  /// \param moved  vertices that lie elsewhere by now, keys ascending
  SideMesh load(std::size_t block, std::span<const SafePlace> moved) const;
  /// Most that loading a block and looking for crossings allocates.
  std::uint64_t bytes(std::size_t block) const;
  /// The same where so many faces of the block, and of others around it, are at its sides.
  static std::uint64_t bytes(std::uint64_t own_faces, std::uint64_t near_faces);

 private:
  struct Box {
    Double3 low, high;
  };
  Box cube(const SideEntry& e) const;
  /// Blocks that touch one, ascending.
  std::vector<std::size_t> blocks_around(std::size_t block) const;

  std::vector<PackedFile> files_;
  std::vector<SideEntry> entries_;   ///< ascending by brick within a file
  std::vector<std::uint32_t> file_;  ///< of each
  std::vector<std::size_t> first_;   ///< by file, one more at the end
  std::vector<std::size_t> order_;   ///< all blocks, ascending by brick
  std::array<double, 4> frame_ = {};
};

}  // namespace tessera
