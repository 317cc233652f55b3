/// \file near_faces.h
/// Faces of the welded mesh that reach into one brick, and which of them may cross others.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "kernels/mesh/risky_crossings.h"
#include "stream/stages/weld/numbered_patches.h"
#include "stream/stages/weld/patch_cache.h"
#include "stream/stages/weld/patch_positions.h"
#include "stream/stages/weld/written_positions.h"

namespace tessera {

/// Kept faces of a patch: all of them, or its rim, those with a corner beyond the brick or at its sides.
struct PatchView {
  struct Vertex {
    Float3 position;  ///< cells from the min corner of its owner's brick
    Int3 owner;
    std::uint64_t name = 0;               ///< patch_vertex()
    std::uint8_t returns = 0, risky = 0;  ///< it may go back; it makes its faces risky
  };
  std::vector<Vertex> vertices;
  std::vector<PatchFace> faces;
  std::vector<std::uint16_t> reach;  ///< of a rim, per face: into which bricks around it comes
  [[nodiscard]] std::uint64_t bytes() const {
    return sizeof(Vertex) * vertices.size() + sizeof(PatchFace) * faces.size() +
           sizeof(std::uint16_t) * reach.size() + 256;
  }
};

/// Rims of patches for all tasks of a stage, on any threads: up to 26 bricks around ask for each, of several tasks, and a rim is a tenth of
/// what is read for it.
class PatchRims {
 public:
  static constexpr std::uint64_t kMaxBytes = std::uint64_t{12} << 20;

  /// \param load  makes it where it is not kept, on as many threads at once as ask
  std::shared_ptr<const PatchView> get(std::size_t patch, const std::function<PatchView()>& load);

 private:
  struct Rim {
    std::shared_ptr<const PatchView> view;
    [[nodiscard]] std::uint64_t bytes() const { return view ? view->bytes() : 0; }
  };
  std::mutex mutex_;
  PatchCache<Rim> rims_{kMaxBytes};
};

/// Reads the patches around the brick at work, and keeps what it may need again. One thread's.
class NearFaces {
 public:
  /// \param round  of the pass "uncross", from 0: in the first, faces are risky whose corners may go back; later, those of
  ///               which one did in the round before
  /// \param written  where faces are compared: rounding may make some cross that do not on the lattice
  /// \param rims  of the round
  NearFaces(const std::filesystem::path& work, const PatchStore& store, const Numbering& numbering, int round,
            const WrittenPositions& written, PatchRims& rims)
      : written_(written),
        store_(store),
        numbering_(numbering),
        round_(round),
        rims_(rims),
        numbered_(work, store, numbering),
        positions_(work, store, round) {}

  /// Pairs of faces that cross or overlap in the brick, a risky one among them.
  /// \param back  gets the corners of both that may go back, as patch_vertex(), some of them more than once
  /// \returns how many
  std::uint64_t find_crossings(const Int3& brick, std::vector<std::uint64_t>& back);

  /// Of patches around, so many faces that reach into a brick take part; beyond, it is counted as torn.
  static constexpr std::size_t kMaxReaching = 20'000;
  std::uint64_t torn_bricks() const { return torn_; }
  /// Most that it holds over these patches.
  static std::uint64_t bytes(std::span<const PatchEntry> patches);

 private:
  static constexpr std::uint64_t kVertexCacheBytes = std::uint64_t{20} << 20;
  static constexpr std::uint64_t kViewCacheBytes = std::uint64_t{8} << 20;

  struct Vertices {
    std::vector<Float3> position, safe;
    std::vector<std::uint8_t> risky;
    std::uint64_t bytes() const { return (2 * sizeof(Float3) + 1) * position.size() + 128; }
  };
  /// false: no face of one of the patch's vertices that is risky reaches into the brick.
  bool may_be_risky(std::size_t patch, const Int3& brick);
  const Vertices& vertices(std::size_t patch);
  const PatchView& view(std::size_t patch);
  void load_vertices(std::size_t patch, Vertices& out);
  void load_view(std::size_t patch, PatchView& out);
  PatchView make_rim(std::size_t patch);
  void add_vertex(const PatchView::Vertex& v, const Int3& brick);
  /// Faces lie in the bricks of their patches, but for those with vertices that were moved.
  void gather(const Int3& brick, const std::vector<std::size_t>& around);

  const WrittenPositions written_;
  const PatchStore& store_;
  const Numbering& numbering_;
  int round_;
  PatchRims& rims_;
  NumberedPatches numbered_;
  PatchPositions positions_;
  PatchCache<Vertices> vertices_{kVertexCacheBytes};
  PatchCache<PatchView> views_{kViewCacheBytes};
  PatchFaces read_;
  RiskyMesh mesh_;                     ///< of the brick at work
  std::vector<std::uint8_t> returns_;  ///< per vertex of it: it may go back
  std::uint64_t torn_ = 0;
};

}  // namespace tessera
