/// \file line_chains.h
/// Chains of edges that levels cross (kernels/survey/contour_chains.h), of all patches of a mesh, joined to lines by the
/// names of their edges. What comes out hangs on the mesh and its levels alone.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <vector>

#include "kernels/survey/contour_chains.h"
#include "stream/files/spill_file.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

/// A chain whose points lie in the file.
struct ChainRecord {
  std::int64_t level = 0;
  EdgeName begin{}, end{}, smallest{};
  std::uint64_t first_point = 0;
  std::uint32_t count = 0, smallest_at = 0;
  std::uint64_t closed = 0;
};
static_assert(sizeof(ChainRecord) == 80);

/// A line by its first chain.
struct ChainedLine {
  std::int64_t level = 0;
  EdgeName name{};  ///< of its first edge
  std::size_t chain = 0;
  bool closed = false;
};

/// Chains of all patches, on disk. Adding is thread-safe.
class ChainFile {
 public:
  explicit ChainFile(const std::filesystem::path& folder) : points_(folder), records_(folder) {}
  void add(const std::vector<ContourChain>& chains);
  std::uint64_t count() const { return count_; }
  std::vector<ChainRecord> records() const;
  void read_points(const ChainRecord& r, Double2* to, std::size_t count) const;

 private:
  SpillFile points_, records_;
  std::uint64_t point_count_ = 0, count_ = 0;
  std::mutex mutex_;
};

/// Chains of the levels first to end (exclusive) in a block, so many levels at a time as the memory of chain_bytes() does.
/// \param shift  added to their levels \throws StoppedError
void chain_levels(const MeshBlock& block, const ContourLevels& levels, std::int64_t first, std::int64_t end,
                  std::int64_t shift, ChainFile& file);
/// What a patch takes with chain_levels().
std::uint64_t chain_bytes(const MeshPatchEntry& entry);

/// Chains of the whole mesh, and which one goes on where another ends.
class ChainGraph {
 public:
  /// Of one chain, while the graph is made.
  static constexpr std::uint64_t kBytes = sizeof(ChainRecord) + sizeof(ChainedLine) + 2 * sizeof(std::size_t);

  /// \param file  outlives it
  explicit ChainGraph(const ChainFile& file);
  /// Ascending by level.
  const std::vector<ChainedLine>& lines() const { return lines_; }
  std::uint64_t point_count(const ChainedLine& line) const;
  /// Of closed lines the first point is not repeated. Empty where a line goes nowhere.
  std::vector<Double2> points(const ChainedLine& line) const;

 private:
  std::size_t index_of(const ChainRecord& c) const { return static_cast<std::size_t>(&c - chains_.data()); }
  template <class Use>
  void for_chains(const ChainedLine& line, const Use& use) const;

  const ChainFile& file_;
  std::vector<ChainRecord> chains_;
  std::vector<std::size_t> next_;
  std::vector<ChainedLine> lines_;
};

}  // namespace tessera
