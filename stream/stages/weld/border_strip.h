/// \file border_strip.h
/// What one brick of the welded mesh sees of the border around it.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "stream/stages/weld/numbered_patches.h"

namespace tessera {

/// A face of which a vertex lies at the border.
struct StripFace {
  std::array<VertexSlot, 3> slot;
  std::array<std::uint64_t, 3> number;  ///< in the output
  std::array<Float3, 3> at;  ///< each relative to the brick that owns it, before the stage "border"
  std::uint32_t border = 0;  ///< bit i: corner i lies at the border
};

/// Faces at the border of a brick and of what it sees around it: beyond, it is torn to shreds that no line bounds.
inline constexpr std::size_t kMaxStripFaces = 40'000;

/// Reads the patches around the one at work, and keeps what it may need again. One thread's.
class StripReader {
 public:
  StripReader(const JobState& state, const PatchStore& store, const Numbering& numbering)
      : store_(store), numbering_(numbering), numbered_(state.work, store, numbering) {}

  /// Whether the patch has kept faces and a border.
  bool has_border(std::size_t patch) const;
  /// Faces at the border of which a vertex lies within `halo` cells of the patch's brick, patches in ascending order.
  /// \pre 0 <= reach <= 60: farther than the bricks around it sees nothing
  /// \returns false if there are more than kMaxStripFaces, or in one of the bricks
  bool gather(std::size_t patch, int halo, std::vector<StripFace>& faces);
  /// Corner i of a face, in cells from the min corner of `brick`.
  Double3 corner(const StripFace& face, std::size_t i, const Int3& brick) const;
  /// Whether it lies within `halo` cells of the brick.
  bool is_near(const StripFace& face, std::size_t i, const Int3& brick, int halo) const;
  Int3 brick(std::size_t patch) const { return brick_of_key(store_.patches()[patch].key); }

  /// Most that it holds over these patches, with the faces that are gathered.
  static std::uint64_t bytes(std::span<const PatchEntry> patches);

 private:
  struct Strip {
    std::vector<StripFace> faces;
    bool torn = false;  ///< there are more, which are left out
  };
  struct Vertices {
    std::vector<Float3> position;
    std::vector<VertexClass> kind;
  };
  struct Corner {
    VertexSlot slot;
    std::uint64_t number;
    Float3 at;
    bool border;
  };

  const Strip& get(std::size_t patch);
  const Vertices& vertices(std::size_t patch);
  void read(std::size_t patch, Strip& strip);

  const PatchStore& store_;
  const Numbering& numbering_;
  NumberedPatches numbered_;
  std::map<std::size_t, Vertices> vertices_;
  std::map<std::size_t, Strip> strips_;
  std::uint64_t strip_bytes_ = 0;
  PatchFaces faces_;
  std::vector<Corner> corner_;  ///< of the patch at work, its foreign ones behind its own
};

}  // namespace tessera
