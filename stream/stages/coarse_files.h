/// \file coarse_files.h
/// What the stages of the coarse level of smoothing hand on: sums by patch, the summed matrix, the solution.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "kernels/coarse_system.h"
#include "kernels/smooth.h"
#include "stream/direct_file.h"
#include "stream/mesh_store.h"
#include "stream/stages/smooth_tiles.h"

namespace tessera {

std::string coarse_sums_folder(std::size_t round);
std::string coarse_folder(std::size_t round);
std::string coarse_solution_file(std::size_t round);

/// What one patch adds.
struct PatchSums {
  std::uint64_t patch = 0;
  std::vector<CoarseUnknown> unknowns;  ///< whose names are keys of its own vertices
  std::vector<CoarseEntry> entries;     ///< by row and column
  std::vector<CoarseLoad> loads;        ///< by row
};

/// Sums of the patches of one task, in any order.
class PatchSumsWriter {
 public:
  explicit PatchSumsWriter(const std::filesystem::path& path) : file_(path) {}
  void add(const PatchSums& sums);
  std::uint64_t finish() { return file_.finish(); }

 private:
  DirectFile file_;
};

/// How much lies in some files.
struct PatchSumsCount {
  std::uint64_t unknowns = 0, entries = 0, loads = 0, largest_patch_bytes = 0;
};
PatchSumsCount count_patch_sums(const std::vector<std::filesystem::path>& files);
/// Hands out every patch of the files, one at a time.
void read_patch_sums(const std::vector<std::filesystem::path>& files,
                     const std::function<void(const PatchSums&)>& sink);

/// Every solution has a name and a displacement for each unknown.
void save_coarse_solution(const std::filesystem::path& path, std::span<const CoarseUnknown> unknowns,
                          std::span<const Double3> values);
CoarseSolution load_coarse_solution(const std::filesystem::path& path);
/// Bytes of the solution in memory.
std::uint64_t coarse_solution_bytes(const std::filesystem::path& path);

/// Positions in `store`, which has the same patches, of the vertices of a tile that were loaded from another one.
std::vector<Double3> positions_of(const MeshStore& loaded, const MeshStore& store, const MeshHaloBlock& near,
                                  const SmoothTile& tile);

}  // namespace tessera
