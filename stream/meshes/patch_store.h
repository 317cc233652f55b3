/// \file patch_store.h
/// Patches on disk: packed files of many bricks each, in Morton order of bricks over all files. Every patch has one
/// section for what welding reads (foreign, exported, components), one for its vertices, one for its faces, one for where
/// vertices may go back to.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "kernels/mesh/patch.h"
#include "kernels/mesh/patch_components.h"
#include "stream/files/packed_file.h"

namespace tessera {

/// One patch of the store, as its table has it.
struct PatchEntry {
  std::uint64_t key = 0;          ///< Morton code of the brick
  std::uint64_t offset = 0;       ///< of its first section in the file
  std::uint64_t seam_hash = 0;    ///< of foreign, exported and components
  std::uint64_t vertex_hash = 0;  ///< of positions, colours and classes
  std::uint64_t face_hash = 0;
  std::uint64_t safe_hash = 0;
  std::uint32_t vertices = 0;
  std::uint32_t faces = 0;
  std::uint32_t foreign = 0;
  std::uint32_t exported = 0;
  std::uint32_t components = 0;
  std::uint32_t safe = 0;  ///< vertices that may go back
  std::uint16_t has_colour = 0;
  std::uint16_t has_synthetic = 0;  ///< some face closes a hole
};

/// What welding needs of a patch: everything but the mesh itself.
struct PatchSeam {
  std::vector<VertexKey> foreign;
  std::vector<VertexKey> exported_key;        ///< ascending
  std::vector<std::uint32_t> exported_index;  ///< own vertex of each
  PatchComponents components;
};

class PatchFileWriter {
 public:
  explicit PatchFileWriter(const std::filesystem::path& path);
  /// Patches in ascending brick order.
  void add(const Patch& patch, const PatchComponents& components);
  /// Returns bytes written.
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  PackedWriter file_;
  std::vector<PatchEntry> table_;
};

/// All patches of a job. Holds the tables only (80 bytes a patch). Reading is thread-safe.
class PatchStore {
 public:
  /// \throws InputError naming the file when one is damaged
  explicit PatchStore(const std::vector<std::filesystem::path>& files);

  std::span<const PatchEntry> patches() const {
    return patches_.entries();
  }  ///< ascending key, over all files
  /// Patch indices [first, last).
  std::pair<std::size_t, std::size_t> file_range(std::size_t file) const { return patches_.file_range(file); }
  std::size_t file_count() const { return patches_.file_count(); }
  std::size_t file_of(std::size_t patch) const { return patches_.file_index(patch); }
  /// Patch index, -1 if the brick has no patch.
  std::int64_t find(std::uint64_t key) const { return patches_.index_of(key); }

  PatchSeam load_seam(std::size_t patch) const;
  /// \param vertex_class  may be null
  void load_vertices(std::size_t patch, std::vector<Float3>& position, std::vector<std::uint32_t>& rgba,
                     std::vector<VertexClass>* vertex_class = nullptr) const;
  /// \param synthetic  per face, empty if none closes a hole; may be null
  void load_faces(std::size_t patch, std::vector<PatchFace>& faces,
                  std::vector<std::uint8_t>* synthetic = nullptr) const;
  std::vector<SafeVertex> load_safe(std::size_t patch) const;

 private:
  PackedTables<PatchEntry> patches_;
};

}  // namespace tessera
