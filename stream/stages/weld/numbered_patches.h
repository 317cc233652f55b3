/// \file numbered_patches.h
/// Patches after welding: every kept vertex by its number in the output.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "stream/stages/weld/patch_positions.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {

/// Patches with kept faces among the 27 around a brick, ascending.
std::vector<std::size_t> kept_patches_around(const PatchStore& store, const Numbering& numbering,
                                             const Int3& brick);

/// Faces of a patch one after the other lie beside each other: who looks for those in a place keeps a box of so many.
inline constexpr std::size_t kFaceRun = 32;

/// The faces of one patch, with what each of its vertices is called outside.
struct PatchFaces {
  std::vector<PatchFace> faces;         ///< of the patch, dropped islands among them
  std::vector<std::uint8_t> synthetic;  ///< per face, empty if none of them closes a hole
  std::vector<VertexSlot> foreign;      ///< places of the foreign vertices
  std::vector<std::uint64_t> index;     ///< output number per own, then per foreign vertex
  static constexpr std::uint64_t kDropped = ~std::uint64_t{0};  ///< index of a vertex of a dropped island
  bool kept(const PatchFace& f) const { return index[f[0]] != kDropped; }
};

/// One thread's view of the patches: keeps a bounded cache.
class NumberedPatches {
 public:
  /// \param positions  of all threads; loaded when they are asked for if there are none
  NumberedPatches(const std::filesystem::path& work, const PatchStore& store, const Numbering& numbering,
                  std::shared_ptr<const PatchPositions> positions = nullptr)
      : work_(work), store_(&store), numbering_(&numbering), positions_(std::move(positions)) {}

  /// \pre the patch has kept faces
  void load_faces(std::size_t patch, PatchFaces& out);
  /// The patch's own vertices, in the order of their numbers in the output: what goes is gone, what later passes
  /// moved has moved. \pre these are done
  /// \param position  cells, relative to the brick  \param rgba  empty if the patch has no colour
  void load_kept_vertices(std::size_t patch, std::vector<Float3>& position, std::vector<std::uint32_t>& rgba);

  /// Own vertices that are kept, ascending: the first of them has the patch's first number in the output.
  std::vector<std::uint32_t> kept_vertices(std::size_t patch) const;

  /// Most that the caches take, beyond one patch's faces.
  static constexpr std::uint64_t kCacheBytes = std::uint64_t{16} << 20;

 private:
  static constexpr std::uint32_t kGone = 0xffffffffu;
  /// Own number before islands are dropped -> after, kGone where the vertex goes with its island.
  std::vector<std::uint32_t> make_remap(std::size_t patch) const;
  std::uint64_t output_index(const VertexSlot& slot);

  std::filesystem::path work_;
  const PatchStore* store_;
  const Numbering* numbering_;
  std::map<std::size_t, std::vector<std::uint32_t>> remaps_;  ///< of patches that lost an island
  std::int64_t open_file_ = -1;                               ///< whose places are open
  std::unique_ptr<WeldFile> slots_;
  std::shared_ptr<const PatchPositions> positions_;
};

}  // namespace tessera
