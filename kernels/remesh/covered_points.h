/// \file covered_points.h
/// Points of a reference that an edited mesh must stay near: each belongs to the nearest face, and edits hand them on to the
/// faces that they make.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"

namespace tessera {

class CoveredPoints {
 public:
  /// Vertices of the reference, middles of its edges, centres of its faces.
  /// \param mesh      outlives this, as do the spans
  /// \param position  relative to its origin \param faces  of these
  /// \param limit     scan units: no point gets farther away than that, or than it is; those a third farther away than that
  ///                  from all faces are nobody's
  CoveredPoints(const CollapseMesh& mesh, std::span<const Double3> position,
                std::span<const std::array<std::uint32_t, 3>> faces, double limit);

  /// Whether every point of `faces` stays near to one of `made`, which an edit would put there.
  [[nodiscard]] bool stay_near(std::span<const std::uint32_t> faces,
                               std::span<const std::array<Double3, 3>> made) const;
  /// The points of `faces` now belong to the nearest of `made`, as the mesh is. Both may share faces.
  void hand_on(std::span<const std::uint32_t> faces, std::span<const std::uint32_t> made);

  [[nodiscard]] std::size_t count(std::uint32_t face) const;

 private:
  static constexpr std::uint32_t kEnd = 0xffffffffu;
  const CollapseMesh& mesh_;
  /// Three on its edges, one inside.
  static constexpr std::size_t kOfFace = 4;
  Double3 point(std::size_t p) const;
  bool comes_again(std::size_t p) const;
  std::span<const Double3> position_;
  std::span<const std::array<std::uint32_t, 3>> faces_;
  std::vector<std::uint32_t> first_, next_;  ///< per face its first point, per point the next of its face
  std::vector<float> square_;                ///< per point, of the distance that it may have
};

}  // namespace tessera
