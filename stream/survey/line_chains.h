/// \file line_chains.h
/// Chains of edges that levels cross (kernels/survey/contour_chains.h), of all patches of a mesh, joined to lines by the
/// names of their edges. What comes out hangs on the mesh and its levels alone.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "kernels/survey/contour_chains.h"
#include "stream/files/spill_file.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"

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

/// Calls chain(patch) for every patch, on the threads of the pool. \param bytes  what it takes
/// \throws StoppedError; ResourceError as WorkerPool::run_tasks()
void chain_patches(const MeshStore& store, WorkerPool& pool, MemoryBudget& budget,
                   const std::function<std::uint64_t(const MeshPatchEntry&)>& bytes,
                   const std::function<void(std::size_t)>& chain);

/// Chains of the whole mesh, and which one goes on where another ends.
class ChainGraph {
 public:
  /// \param file,budget  outlive it   \param who  the command, for messages
  /// \throws ResourceError when the budget cannot hold the ends of all chains
  ChainGraph(const ChainFile& file, const MemoryBudget& budget, std::string who);
  /// Ascending by level.
  const std::vector<ChainedLine>& lines() const { return lines_; }
  /// Of closed lines the first point is not repeated. Empty where a line goes nowhere.
  /// \param times  room for so many copies of them  \throws ResourceError when the budget cannot hold the line
  std::vector<Double2> points(const ChainedLine& line, std::uint64_t times = 2) const;

 private:
  /// Of one chain, while the graph is made.
  static constexpr std::uint64_t kBytes = sizeof(ChainRecord) + sizeof(ChainedLine) + 2 * sizeof(std::size_t);
  std::uint64_t point_count(const ChainedLine& line) const;
  std::size_t index_of(const ChainRecord& c) const { return static_cast<std::size_t>(&c - chains_.data()); }
  template <class Use>
  void for_chains(const ChainedLine& line, const Use& use) const;

  const ChainFile& file_;
  const MemoryBudget& budget_;
  std::string who_;
  std::vector<ChainRecord> chains_;
  std::vector<std::size_t> next_;
  std::vector<ChainedLine> lines_;
};

}  // namespace tessera
