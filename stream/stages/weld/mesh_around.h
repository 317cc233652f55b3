/// \file mesh_around.h
/// Faces of the welded mesh near a place, with the positions that it is written with.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "kernels/mesh/box_mask.h"
#include "kernels/mesh/face_contact.h"
#include "stream/stages/weld/numbered_patches.h"
#include "stream/stages/weld/patch_cache.h"

namespace tessera {

/// Reads the patches around, and keeps what it may need again. One thread's.
class MeshAround {
 public:
  MeshAround(const std::filesystem::path& work, const PatchStore& store, const Numbering& numbering)
      : store_(store), numbering_(numbering), numbered_(work, store, numbering) {}

  /// Adds the faces whose boxes of whole cells meet those of `near`, widened, as a coarse mask has them; corners are in cells from
  /// `origin` and named by their numbers in the output. Faces without area are left out.
  /// \param origin  whole cells from the lattice origin
  /// \param near    corners in cells from there; nothing is added where there are none
  void gather_near(const Double3& origin, std::span<const ContactFace> near, double margin,
                   std::vector<ContactFace>& out);

  /// Edges of the faces there, flat ones too, both ends of which are among `vertices`: low and high number, ascending.
  /// \param vertices  ascending
  std::vector<std::array<std::uint64_t, 2>> edges_between(const Double3& origin, const Double3& low,
                                                          const Double3& high,
                                                          std::span<const std::uint64_t> vertices);

  /// Most that it holds over these patches.
  static std::uint64_t bytes(std::span<const PatchEntry> patches);

 private:
  static constexpr std::uint64_t kVertexCacheBytes = std::uint64_t{4} << 20;
  static constexpr std::uint64_t kViewCacheBytes = std::uint64_t{8} << 20;

  void gather(const Double3& origin, const Double3& low, const Double3& high, const BoxMask& near,
              std::vector<ContactFace>& out);
  /// Whole cells around faces, from the min corner of their patch's brick.
  struct Box {
    std::array<std::int16_t, 3> low, high;
  };
  /// Kept vertices and faces of a patch.
  struct View {
    std::uint64_t first = 0;  ///< output number of the first own vertex; they are one after the other
    std::vector<Float3> own;  ///< cells from the min corner of the brick
    std::vector<Double3> foreign;
    std::vector<std::uint64_t> foreign_number;
    std::vector<PatchFace> faces;  ///< own vertices first
    std::vector<Box> runs;         ///< per kFaceRun faces: most are passed over by a look at these
    Double3 position(std::uint32_t v) const {
      return v < own.size() ? wide(own[v]) : foreign[v - own.size()];
    }
    std::uint64_t number(std::uint32_t v) const {
      return v < own.size() ? first + v : foreign_number[v - own.size()];
    }
    std::uint64_t bytes() const {
      return own.size() * sizeof(Float3) + foreign.size() * (sizeof(Double3) + 8) +
             faces.size() * sizeof(PatchFace) + runs.size() * sizeof(Box) + 256;
    }
  };
  struct Vertices {
    std::vector<Float3> position;
    std::uint64_t bytes() const { return position.size() * sizeof(Float3) + 128; }
  };
  const std::vector<Float3>& vertices(std::size_t patch);
  const View& view(std::size_t patch);
  void load_view(std::size_t patch, View& out);
  /// Calls use(face) for the faces there, their corners in cells from `origin`. \param run  (low, high) of a box: false where
  /// no face in it is of use
  template <class Run, class Use>
  void for_each_face(const Double3& origin, const Double3& low, const Double3& high, const Run& run,
                     const Use& use);
  template <class Run, class Use>
  void for_each_face_of(std::size_t patch, const Double3& origin, const Double3& low, const Double3& high,
                        const Run& run, const Use& use);

  const PatchStore& store_;
  const Numbering& numbering_;
  NumberedPatches numbered_;
  PatchCache<Vertices> vertices_{kVertexCacheBytes};
  PatchCache<View> views_{kViewCacheBytes};
  PatchFaces read_;
};

}  // namespace tessera
