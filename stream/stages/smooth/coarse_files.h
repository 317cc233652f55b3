/// \file coarse_files.h
/// What the stages of the coarse level of smoothing hand on: sums by patch, the summed matrix, the solution, how a plate
/// bends.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "kernels/smooth/coarse_system.h"
#include "kernels/smooth/smooth.h"
#include "stream/files/packed_file.h"
#include "stream/meshes/mesh_store.h"
#include "stream/stages/smooth/smooth_tiles.h"

namespace tessera {

std::string coarse_sums_folder(std::size_t round);
std::string coarse_folder(std::size_t round);
std::string coarse_solution_file(std::size_t round);
std::string laplacian_folder(std::size_t round);

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
  explicit PatchSumsWriter(const std::filesystem::path& path);
  void add(const PatchSums& sums);
  std::uint64_t finish() { return file_.finish(table_); }

  struct Entry {
    std::uint64_t patch;
    Section unknowns, entries, loads;
  };

 private:
  PackedWriter file_;
  std::vector<Entry> table_;
};

/// How much lies in some files.
struct PatchSumsCount {
  std::uint64_t unknowns = 0, entries = 0, loads = 0, largest_patch_bytes = 0;
};
PatchSumsCount count_patch_sums(const std::vector<std::filesystem::path>& files);
/// Hands out every patch of the files, one at a time.
void read_patch_sums(const std::vector<std::filesystem::path>& files,
                     const std::function<void(const PatchSums&)>& sink);

/// Every solution has a name and a value for each unknown.
void save_coarse_solution(const std::filesystem::path& path, std::span<const CoarseUnknown> unknowns,
                          std::span<const CoarseValue> values);
CoarseSolution load_coarse_solution(const std::filesystem::path& path);
/// Bytes of the solution in memory.
std::uint64_t coarse_solution_bytes(const std::filesystem::path& path);

/// How the vertices of some patches bend (order 2), in the order of each patch.
class PatchLaplacianWriter {
 public:
  explicit PatchLaplacianWriter(const std::filesystem::path& path);
  void add(std::uint64_t patch, std::span<const Float3> laplacian);
  std::uint64_t finish() { return file_.finish(table_); }

  struct Entry {
    std::uint64_t patch;
    Section laplacian;
  };

 private:
  PackedWriter file_;
  std::vector<Entry> table_;
};

class PatchLaplacians {
 public:
  /// \throws InputError for a damaged file
  explicit PatchLaplacians(const std::vector<std::filesystem::path>& files);
  bool empty() const { return slots_.empty(); }
  std::vector<Float3> load(std::uint64_t patch) const;

 private:
  struct PatchSlot {
    std::size_t file;
    Section laplacian;
  };
  std::vector<PackedFile> files_;
  std::map<std::uint64_t, PatchSlot> slots_;
};

/// Where the vertices of a tile are in the middle of a step.
struct TileState {
  std::vector<Double3> now;
  std::vector<Float3> laplacian;  ///< empty without bends

  static constexpr std::uint64_t bytes(std::uint64_t vertices) {
    return (sizeof(Double3) + sizeof(Float3)) * vertices;
  }
};

/// \param loaded  that the tile was loaded from \param store  where they are; the same patches
TileState tile_state(const MeshStore& loaded, const MeshStore& store, const PatchLaplacians& laplacians,
                     const MeshHaloBlock& near, const SmoothTile& tile);

}  // namespace tessera
