/// \file copc_nodes.h
/// Points dealt to the nodes of an octree of which every level adds points to those above it, outside of memory. Cubes with few points
/// are leaves and keep them all; others take one point of every cell, a 128th of their edge wide, and leave the rest to the next level.
/// Which one is decided by Morton order alone, so nodes do not hang on the order in which points come.
/// Source: COPC 1.0 (Hobu); Schütz, Ohrhallinger and Wimmer, "Fast Out-of-Core Octree Generation for Massive Point Clouds", 2020.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "octree/lattice.h"
#include "stream/files/spill_file.h"

namespace tessera {

struct CopcCube {
  Double3 min{};
  double edge = 1.0;
};

struct CopcNode {
  std::int32_t level = 0;
  std::array<std::int32_t, 3> at{};  ///< in its level
  std::uint64_t points = 0;
  std::uint64_t offset = 0;  ///< among those of its level
};

class CopcNodes {
 public:
  static constexpr int kCellLevels = 7;                   ///< a cell is so many levels finer than its node
  static constexpr std::uint64_t kLeafPoints = 40'000;    ///< cubes with no more are leaves
  static constexpr std::uint64_t kMostPoints = 1u << 24;  ///< of a node

  /// \param record_bytes  of a point; its position lies first in it, as three whole numbers of 32 bits
  /// \param memory_bytes  of the sort, which is nearly all that is held
  /// \throws UsageError for records of more than 256 bytes
  CopcNodes(const std::filesystem::path& temp, std::size_t record_bytes, std::uint64_t memory_bytes);
  ~CopcNodes();

  /// Whole records.
  void add(std::string_view records);
  /// Once, after the last point. \param scale,offset  of positions
  /// \throws ResourceError where more points than kMostPoints lie in one place, or the disk is full
  void build(const Double3& scale, const Double3& offset, const std::filesystem::path& output);

  const CopcCube& cube() const { return cube_; }
  /// By level and, within one, in Morton order; none is empty, and the parent of each is there.
  const std::vector<CopcNode>& nodes() const { return nodes_; }
  /// In Morton order. \pre build()
  std::string records(const CopcNode& node) const;

 private:
  class Dealer;
  template <std::size_t kBytes>
  void sort_and_deal(const Double3& scale, const Double3& offset, Dealer& dealer);
  void find_cube(const Double3& scale, const Double3& offset);

  std::filesystem::path temp_;
  std::size_t record_bytes_;
  std::uint64_t memory_bytes_;
  SpillFile given_;
  std::string pending_;  ///< of given_, not yet there
  std::array<std::int32_t, 3> low_{}, high_{};
  bool any_ = false;
  CopcCube cube_;
  std::vector<CopcNode> nodes_;
  std::vector<std::unique_ptr<SpillFile>> levels_;
};

/// The pages of a hierarchy, one after the other, the root page first.
struct CopcPages {
  std::string bytes;
  std::uint64_t root_bytes = 0;
};
/// Where a node lies in the file.
struct CopcChunkAt {
  std::uint64_t offset = 0;
  std::int32_t bytes = 0;
};
/// Few nodes share one page, many are cut at every fifth level. \param nodes  as CopcNodes has them \param chunks  of each
/// \param begin  offset of the pages in the file
CopcPages copc_pages(const std::vector<CopcNode>& nodes, const std::vector<CopcChunkAt>& chunks,
                     std::uint64_t begin, std::size_t single_page_nodes = 8192);

}  // namespace tessera
