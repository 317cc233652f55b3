/// \file merge_sheet.h
/// Overlapping meshes as one surface: which of them counts where, and the signed distance of what they are together.
/// Sources: thesis 3.1.1 (zippering: where patches overlap one of them goes), 2.2 and 4.2.3 (fields of meshes, combined).
///
/// Meshes come in order of rank, the best first. A mesh covers a place as far as it goes on there: 1, falling to 0 over
/// its fade towards the borders that another mesh passes (its joints). The best takes what it covers, the next takes
/// that share of the rest, and so on; the distance is the mean by these shares. So the surface is the best mesh's where
/// it has any, passes into the next one before it ends, and is nowhere cut.
#pragma once
#include <span>
#include <utility>
#include <vector>

#include "kernels/mesh/signed_distance.h"

namespace tessera {

struct MergeRange {
  double apart = 0.0;   ///< how far from each other surfaces may be that are the same one, world units
  double beyond = 0.0;  ///< how far beyond a border that is no joint a mesh still counts
};

/// One mesh around some block.
class MergeSheet {
 public:
  /// \param joints  border edges as triangles (a, b, b), of the same origin; may be empty  \param fade  > 0
  MergeSheet(SignedDistance surface, ClosestFaces joints, double fade)
      : surface_(std::move(surface)), joints_(std::move(joints)), fade_(fade) {}

  struct Sample {
    SignedDistance::Foot foot;
    double cover = 0.0;    ///< within [0, 1]
    double lateral = 0.0;  ///< how far beyond the border, at right angles to the normal
  };
  /// \param p  relative to the origin  \param maximum  farther from the mesh nothing is covered
  /// \param normal  if not null: a surface there with this normal (unit) is covered by faces that look the same way
  [[nodiscard]] Sample at(const Double3& p, double maximum, double beyond,
                          const Double3* normal = nullptr) const;
  /// Cover of a place on the mesh itself.
  double own_cover(const Double3& p) const;
  /// Whether the mesh goes on at a point beyond another one's border.
  [[nodiscard]] bool passes(const Double3& p, const MergeRange& range, const Double3& normal) const;

  [[nodiscard]] const SignedDistance& surface() const { return surface_; }

 private:
  SignedDistance surface_;
  ClosestFaces joints_;
  double fade_;
};

/// All meshes around some block, in order of rank.
class MergeBlend {
 public:
  static constexpr int kMixed = -1;

  /// \param sheets  of one origin; null where a mesh is not near; must outlive this
  MergeBlend(std::span<const MergeSheet* const> sheets, const MergeRange& range)
      : sheets_(sheets.begin(), sheets.end()), range_(range) {}

  struct Value {
    double share = 0.0;     ///< of all meshes together; 0: no surface near, the rest says nothing
    double distance = 0.0;  ///< < 0 inside
    Double3 normal{};       ///< unit or zero
    double lateral = 0.0;   ///< least of those that have a share: how far beyond a border
  };
  /// \param more  beyond MergeRange::apart, how far from the meshes
  [[nodiscard]] Value at(const Double3& p, double more) const;
  /// The mesh with the largest share, and its vertex there. \pre at() has a share
  [[nodiscard]] std::pair<std::size_t, std::uint32_t> main_vertex(const Double3& p, double more) const;
  /// Whose a place on mesh `own` is: a rank, or kMixed. \param normal  unit, of the mesh there
  [[nodiscard]] int owner(const Double3& p, int own, const Double3& normal) const;

 private:
  std::vector<const MergeSheet*> sheets_;
  MergeRange range_;
};

}  // namespace tessera
