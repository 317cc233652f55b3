/// \file moved_patches.h
/// The store of a surface with levels, its vertices where the pass "border" moved them. A vertex belongs to the first patch
/// that has it, which alone says where it goes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/files/packed_file.h"
#include "stream/meshes/mesh_store.h"
#include "stream/stages/weld/patch_cache.h"

namespace tessera {

/// A vertex of a store that moves.
struct VertexMove {
  std::uint64_t key = 0;
  Double3 to{};  ///< as the store holds positions
};

inline constexpr const char* kLevelBorderFolder = "border/";
std::string vertex_moves_file(std::size_t task);

class VertexMovesWriter {
 public:
  explicit VertexMovesWriter(const std::filesystem::path& path);
  /// Of the vertices that belong to a patch; patches and keys ascending.
  void add(std::uint64_t brick, const std::vector<VertexMove>& moves);
  /// Returns bytes written.
  std::uint64_t finish() { return file_.finish(table_); }

  struct Entry {
    std::uint64_t key = 0;  ///< of the patch
    Section moves;
  };

 private:
  PackedWriter file_;
  std::vector<Entry> table_;
};

/// Patches whose boxes meet that of one, itself among them, ascending. \param margin  scan units, around its box
std::vector<std::size_t> patches_near(const MeshStore& store, std::size_t patch, double margin);

/// Runs of patches, a task each: the same whatever the job may take. \return first patch of every run, and the end
std::vector<std::size_t> patch_runs_of(const MeshStore& store);

/// Reads patches, and keeps what it may need again. One thread's.
class MovedPatches {
 public:
  /// \param store  outlives it
  MovedPatches(const MeshStore& store, const std::filesystem::path& work);

  /// \param moved  whether any vertex lies elsewhere; may be null
  MeshBlock load(std::size_t patch, bool* moved = nullptr);
  /// The same, kept for a while: holds until another patch is asked for.
  const MeshBlock& get(std::size_t patch);

  /// Most that it holds, with the patch that it reads.
  static std::uint64_t bytes(std::uint64_t largest_patch_bytes);

 private:
  struct Moves {
    std::vector<VertexMove> list;
    std::uint64_t bytes() const { return list.size() * sizeof(VertexMove) + 64; }
  };
  struct Loaded {
    MeshBlock block;
    std::uint64_t bytes() const {
      return MeshStore::block_bytes(block.key.size(), block.faces.size()) + sizeof(Loaded);
    }
  };

  const MeshStore& store_;
  PackedTables<VertexMovesWriter::Entry> tables_;
  PatchCache<Moves> moves_;
  PatchCache<Loaded> blocks_;
};

}  // namespace tessera
