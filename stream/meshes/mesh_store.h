/// \file mesh_store.h
/// A mesh of any size on disk: packed files of patches, one patch per brick of the store's lattice. Extracted
/// and imported meshes, every pass over them, and references all live in stores.
///
/// A face is in exactly one patch. A vertex is stored with every patch that uses it, with its global key and its exact
/// position, and every face says at which of its edges the surface ends: whether a star is complete is decided in the
/// block alone, nothing else crosses bricks. Patches may be compact (patch_coding.h).
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "octree/lattice.h"

namespace tessera {

/// What all files of a store agree on.
struct MeshStoreInfo {
  Lattice lattice;
  bool double_positions = false;  ///< positions need more than floats; else all of them are floats exactly
  bool colour = false;
  Double3 shift = {0, 0, 0};  ///< as MeshHeader::shift of the file that was read, to be written back
  bool operator==(const MeshStoreInfo&) const = default;
};

/// Closed box, scan units.
struct MeshBox {
  Double3 low = {0, 0, 0};
  Double3 high = {0, 0, 0};
};
bool overlap(const MeshBox& a, const MeshBox& b);
MeshBox grown(const MeshBox& box, double margin);

enum MeshPatchContent : std::uint32_t {
  kPatchBounds = 1,     ///< faces come with MeshBlock::face_bound
  kPatchSynthetic = 2,  ///< some face closes a hole
  kPatchCompact = 4,    ///< packed as patch_coding.h has it
  kPatchAlone = 8,      ///< for who wrote it: the brick is a block of its own
};

/// One patch of the store, as its table has it.
struct MeshPatchEntry {
  std::uint64_t key = 0;                         ///< Morton code of the brick
  std::uint64_t offset = 0;                      ///< of its section of vertices; that of faces lies behind it
  std::uint64_t vertex_hash = 0, face_hash = 0;  ///< of the sections
  std::uint32_t vertices = 0, faces = 0;         ///< > 0
  std::uint32_t file = 0;                        ///< index of the file; not on disk
  std::uint32_t content = 0;                     ///< bits of MeshPatchContent
  std::uint32_t vertex_bytes = 0, face_bytes = 0;
  MeshBox box;  ///< of all vertices; faces may reach out of their brick
};

class MeshStore;

class MeshFileWriter {
 public:
  MeshFileWriter(const std::filesystem::path& path, const MeshStoreInfo& info);
  ~MeshFileWriter();
  MeshFileWriter(const MeshFileWriter&) = delete;
  MeshFileWriter& operator=(const MeshFileWriter&) = delete;
  /// The patch of one brick, each at most once over all files of a store. Patches without faces are left out.
  /// \pre canonical (mesh_block.h), every vertex used by a face
  /// \param content  kPatchCompact, kPatchAlone or both; the other bits go by the patch
  void add(std::uint64_t brick, const MeshBlock& patch, unsigned content = 0);
  /// In files that stand in for others (MeshStore): the brick has no patch any more.
  void remove(std::uint64_t brick);
  /// Patch `patch` of a store with its vertices moved; all else is copied as it is.
  /// \pre the store's info agrees, the patch is not compact; one position for each vertex, in the order of the patch
  /// \throws InputError naming the file when the patch is damaged
  void add_moved(const MeshStore& store, std::size_t patch, std::span<const Double3> positions);
  std::uint64_t finish();  ///< returns bytes written

 private:
  char* put_positions(std::span<const Double3> positions, MeshPatchEntry& entry, char* to) const;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Patches that were loaded together, and what lies around them.
struct MeshHaloBlock {
  MeshBlock block;                 ///< canonical
  std::vector<std::uint8_t> core;  ///< per face: 1 in one of the patches asked for, 0 in the halo
  /// load_near() only. Per patch asked for: number in the block of each of its vertices.
  std::vector<std::vector<std::uint32_t>> core_vertices;
  /// load_near() only. Per vertex: the first patch that has it. Right for all vertices of the patches asked for.
  std::vector<std::uint32_t> first_patch;
};

/// All patches of a mesh. Holds the table only (104 bytes a patch). Loading is thread-safe.
class MeshStore {
 public:
  /// \param newer  files whose patches stand in for those of the same brick in `files`
  /// \throws InputError naming the file when one is damaged, of another store, or a brick comes twice
  explicit MeshStore(const std::vector<std::filesystem::path>& files,
                     const std::vector<std::filesystem::path>& newer = {});
  ~MeshStore();
  MeshStore(MeshStore&&) noexcept;
  MeshStore& operator=(MeshStore&&) noexcept;

  const MeshStoreInfo& info() const;
  std::span<const MeshPatchEntry> patches() const;  ///< ascending key, over all files
  std::uint64_t face_count() const;
  bool has_synthetic() const;                  ///< some face closes a hole
  const MeshBox& box() const;                  ///< of the whole mesh
  double diagonal() const;                     ///< of that box
  std::int64_t find(std::uint64_t key) const;  ///< patch index, -1 if the brick has no patch
  /// Indices of the patches whose boxes meet this one, ascending; and the smallest box around some patches.
  std::vector<std::size_t> select(const MeshBox& box) const;
  MeshBox box_of(std::span<const std::size_t> patches) const;

  /// Merges patches (indices ascending) into one canonical block: vertices by key, faces in canonical order.
  MeshBlock load(std::span<const std::size_t> patches) const;
  /// The same, and every face of other patches that comes within `margin` (>= 0) of the core's box, by its own box.
  MeshHaloBlock load_near(std::span<const std::size_t> core, double margin) const;
  /// Every face whose box meets this one.
  MeshBlock load_box(const MeshBox& box) const;
  /// Upper bound of the bytes of a block of these patches while it is loaded.
  std::uint64_t block_bytes(std::span<const std::size_t> patches) const;
  static constexpr std::uint64_t block_bytes(std::uint64_t vertices, std::uint64_t faces) {
    return kBlockBytesPerVertex * vertices + kBlockBytesPerFace * faces;
  }
  std::uint64_t largest_patch_bytes() const;  ///< block_bytes of it

  static constexpr std::uint64_t kBlockBytesPerVertex = 104;
  static constexpr std::uint64_t kBlockBytesPerFace = 48;

 private:
  friend class MeshFileWriter;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
