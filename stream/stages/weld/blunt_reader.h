/// \file blunt_reader.h
/// Faces of the welded mesh near a border, or near what nobody saw, around one brick: what the pass "blunt" works on.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "kernels/mesh/box_mask.h"
#include "kernels/smooth/crease_blunting.h"
#include "stream/stages/weld/numbered_patches.h"
#include "stream/stages/weld/patch_cache.h"
#include "stream/stages/weld/patch_positions.h"

namespace tessera {

/// Reads the patches around the one at work, and keeps what it may need again. One thread's.
class BluntReader {
 public:
  /// \param sparse  points lie farther apart than cells (Plan::is_sparse): of no face they tell how it bends, so that all count
  ///                as what nobody saw
  BluntReader(const std::filesystem::path& work, const PatchStore& store, const Numbering& numbering,
              bool sparse)
      : sparse_(sparse),
        store_(store),
        numbering_(numbering),
        numbered_(work, store, numbering),
        positions_(work, store, kBeforeBlunt) {}

  /// The faces around those that nobody saw, near the patch, patches in ascending order: positions in cells from its brick.
  /// \param name  of its vertices, as patch_vertex(), ascending
  /// \returns false if there are none, or too many
  bool gather(std::size_t patch, CreaseMesh& mesh, std::vector<std::uint64_t>& name);

  /// Most that it holds over these patches, the kernel's scratch counted in.
  static std::uint64_t bytes(std::span<const PatchEntry> patches);

 private:
  static constexpr std::uint64_t kVertexCacheBytes = std::uint64_t{8} << 20;
  static constexpr std::uint64_t kViewCacheBytes = std::uint64_t{16} << 20;

  struct Vertices {
    std::vector<Float3> position;
    std::vector<VertexClass> kind;
    std::uint64_t bytes() const { return position.size() * (sizeof(Float3) + 1) + 128; }
  };
  using Box = std::pair<Double3, Double3>;  ///< low, high corner
  /// Around faces, rounded outwards to parts of a cell, from the min corner of their patch's brick.
  struct FaceBox {
    std::array<std::int16_t, 3> low, high;
    Box shifted(const Double3& shift) const;
    void extend(const FaceBox& other) {
      for (std::size_t a = 0; a < 3; ++a) {
        low[a] = std::min(low[a], other.low[a]);
        high[a] = std::max(high[a], other.high[a]);
      }
    }
    static FaceBox around(const Double3& point);
  };
  /// Kept faces of a patch; positions in cells from the min corner of its brick.
  struct View {
    std::vector<Float3> own;  ///< positions of the patch's own vertices
    std::vector<Double3> foreign;
    std::vector<std::uint64_t> foreign_name;
    std::vector<PatchFace> faces;
    std::vector<std::uint8_t> synthetic;
    std::vector<std::uint8_t> border;    ///< per vertex
    mutable std::vector<FaceBox> boxes;  ///< per face; made when they are asked for
    mutable std::vector<FaceBox> runs;   ///< per kFaceRun faces: most are passed over by a look at these
    std::vector<FaceBox>
        wanted;  ///< around faces at a border or that nobody saw, few beside each other in one
    Double3 position(std::uint32_t v) const {
      return v < own.size() ? wide(own[v]) : foreign[v - own.size()];
    }
    std::uint64_t bytes() const {  // boxes too, whether they are made or not
      return own.size() * sizeof(Float3) + foreign.size() * (sizeof(Double3) + 8) + border.size() +
             faces.size() * (sizeof(PatchFace) + 1 + sizeof(FaceBox)) +
             (faces.size() / kFaceRun + 1 + wanted.size()) * sizeof(FaceBox) + 256;
    }
  };
  /// Vertices of chosen faces, in cells from the brick at work; one of several patches comes several times.
  struct Chosen {
    std::vector<std::uint64_t> name;
    std::vector<Double3> at;
    std::vector<std::uint8_t> border;
    void clear() { name.clear(), at.clear(), border.clear(); }
    std::uint32_t add(std::uint64_t vertex, const Double3& position, std::uint8_t at_border) {
      name.push_back(vertex), at.push_back(position), border.push_back(at_border);
      return static_cast<std::uint32_t>(name.size() - 1);
    }
  };

  /// The faces of a patch that meet the mask; their corners are indices into own_, or behind kForeign into foreign_.
  /// \returns false where they come to too many
  bool add_faces(std::size_t patch, const Double3& shift, const BoxMask& near, CreaseMesh& mesh);

  /// Orders the chosen vertices by their names. Own ones are in order, for patches are; foreign ones are few.
  void join(CreaseMesh& mesh, std::vector<std::uint64_t>& name);

  Double3 offset(std::size_t patch, const Int3& brick) const;

  const Vertices& vertices(std::size_t patch);

  const View& view(std::size_t patch);
  void load_view(std::size_t patch, View& out);
  void make_boxes(const View& view);

  bool sparse_;
  const PatchStore& store_;
  const Numbering& numbering_;
  NumberedPatches numbered_;
  PatchPositions positions_;
  PatchCache<Vertices> vertices_{kVertexCacheBytes};
  PatchCache<View> views_{kViewCacheBytes};
  PatchFaces read_;
  Chosen own_, foreign_;               ///< of the brick at work
  std::vector<std::uint32_t> place_;   ///< per vertex of the patch at hand
  std::vector<FaceBox> point_box_;     ///< the same
  std::vector<std::uint32_t> wanted_;  ///< faces of the patch at hand
};

}  // namespace tessera
