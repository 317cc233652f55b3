/// \file patch_blocks.h
/// Blocks of bricks whose patches are oriented together, and what the stages of orientation leave of them: the links that
/// patches have inside and across blocks, and what every patch hangs on.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "kernels/points/block_signs.h"
#include "kernels/points/top_surface.h"
#include "stream/files/packed_file.h"
#include "stream/points/point_overlay.h"

namespace tessera {

/// Bricks [first, last) of the overlay: a cube of the octree.
struct PatchBlock {
  std::size_t first_brick = 0, last_brick = 0;
  std::uint64_t first_patch = 0;  ///< over all bricks
  std::uint32_t patches = 0;
  std::uint64_t coarse = 0;  ///< coarse surfels
};

/// Cubes of at most 8^3 bricks that hold at most 2^16 patches or are one brick. Hangs on the overlay alone. Morton order.
std::vector<PatchBlock> list_patch_blocks(const PointOverlay& overlay);

/// Blocks [first, last).
struct PatchBlockRange {
  std::size_t first = 0, last = 0;
};

/// Ranges of blocks that are one task: about a full block's patches or bricks each.
std::vector<PatchBlockRange> group_patch_blocks(const std::vector<PatchBlock>& blocks);

/// One block in a file of links: three sections, one behind the other.
struct LinksEntry {
  std::uint64_t key = 0;  ///< of its first brick
  Section inner;          ///< links between its patches, numbered inside it, merged
  Section outer;          ///< links to patches of later blocks, numbered over all bricks, merged
  Section group;          ///< PatchGroup of every patch
};

/// What strong links inside its block join a patch to.
struct PatchGroup {
  std::uint32_t group = 0;  ///< numbered inside the block
  std::int32_t sign = 1;
};

class LinksFileWriter {
 public:
  explicit LinksFileWriter(const std::filesystem::path& path);
  void block(std::uint64_t key, const std::vector<PatchVote>& inner, const std::vector<PatchVote>& outer,
             const PatchGroups& groups);
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  PackedWriter file_;
  std::vector<LinksEntry> table_;
};

/// The files of all blocks, in their order. Thread-safe.
class PatchLinks {
 public:
  static constexpr const char* kFolder = "links";
  static constexpr const char* kExtension = ".tsk";

  explicit PatchLinks(const std::filesystem::path& work);
  std::size_t block_count() const { return tables_.entries().size(); }
  std::uint64_t inner_count(std::size_t block) const {
    return tables_[block].inner.bytes / sizeof(PatchVote);
  }
  std::uint64_t outer_count(std::size_t block) const {
    return tables_[block].outer.bytes / sizeof(PatchVote);
  }
  std::vector<PatchVote> inner(std::size_t block) const {
    return load<PatchVote>(block, tables_[block].inner);
  }
  std::vector<PatchVote> outer(std::size_t block) const {
    return load<PatchVote>(block, tables_[block].outer);
  }
  std::vector<PatchVote> outer() const;  ///< of all blocks
  /// \param weight  of the block's patches
  PatchGroups groups(std::size_t block, const std::vector<std::uint64_t>& weight) const;

 private:
  template <class T>
  std::vector<T> load(std::size_t block, const Section& section) const {
    return tables_.file_of(block).load<T>(section);
  }
  PackedTables<LinksEntry> tables_;
};

/// What all blocks need to know of the job before patches get signs.
struct OrientationScene {
  static constexpr const char* kFile = "links/scene.bin";

  bool from_above = false;                                        ///< its tops decide
  double covered = 0.0, roofed = 0.0, level = 0.0, ground = 0.0;  ///< shares, see TopSurface
  std::vector<std::uint32_t> border;        ///< patches with links to other blocks, ascending
  std::vector<TopColumns::Column> columns;  ///< of scenes from above

  void save(const std::filesystem::path& path) const;
  static OrientationScene load(const std::filesystem::path& path);
  /// Per patch of the block: whether it is one of `border`.
  std::vector<std::uint8_t> border_of(const PatchBlock& block) const;
};

/// One block in a file of anchors: four sections.
struct AnchorsEntry {
  std::uint64_t key = 0;
  Section patches, weight, links, sides;  ///< BlockSigns
  std::uint64_t broken_votes = 0, inner_votes = 0;
};

class AnchorsFileWriter {
 public:
  explicit AnchorsFileWriter(const std::filesystem::path& path);
  void block(std::uint64_t key, const BlockSigns& signs);
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  PackedWriter file_;
  std::vector<AnchorsEntry> table_;
};

/// The files of all blocks, in their order.
class PatchAnchors {
 public:
  static constexpr const char* kFolder = "anchors";
  static constexpr const char* kExtension = ".tsa";

  explicit PatchAnchors(const std::filesystem::path& work);
  const std::vector<AnchorsEntry>& entries() const { return tables_.entries(); }
  std::uint64_t anchor_count() const;
  std::uint64_t vote_count() const;
  template <class T>
  std::vector<T> load(std::size_t block, Section AnchorsEntry::*section) const {
    return tables_.file_of(block).load<T>(tables_[block].*section);
  }

 private:
  PackedTables<AnchorsEntry> tables_;
};

/// Surfels of a block's bricks in the frame of the job, their patches numbered inside the block.
/// \param stats  of the block's patches
std::vector<JobSurfel> load_surfels(const PointOverlay& overlay, const PatchBlock& block,
                                    const std::vector<PatchStats>& stats);
std::vector<PatchStats> load_stats(const PointOverlay& overlay, const PatchBlock& block);

}  // namespace tessera
