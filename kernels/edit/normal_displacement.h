/// \file normal_displacement.h
/// A fine surface as heights over a base surface, along the base's interpolated normals.
/// Source: Kobbelt, Vorsatz, Seidel, "Multiresolution Hierarchies on Unstructured Triangle Meshes", 1999; Botsch, thesis
/// 5.3. For a point p the base point b(u, v) with p = b + h n(u, v) is found by Newton steps from the closest base face on,
/// across edges where they lead. The result hangs on the point and the base alone.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "octree/vector.h"

namespace tessera {

/// 12 bytes: where on the base, and how high.
struct NormalDisplacement {
  std::uint32_t face = 0;      ///< its highest bit says that there is a tangential rest, too
  std::uint16_t u = 0, v = 0;  ///< weights of the face's corners 1 and 2, in units of 1 / 65535
  float height = 0.0f;         ///< along the unit normal
};
static_assert(sizeof(NormalDisplacement) == 12);
inline constexpr std::uint32_t kHasTangent = 0x80000000u;

/// What no normal reaches, beyond borders and where the base folds: a vector in the frame of the base face.
struct TangentRest {
  std::uint32_t point = 0;  ///< which one of those encoded together
  float along = 0.0f;       ///< the side from corner 0 to corner 1, within the tangent plane
  float across = 0.0f;
};

/// Of points encoded together.
struct NormalDisplacements {
  std::vector<NormalDisplacement> of;
  std::vector<TangentRest> rest;  ///< by point
};

/// A base with its vertex normals, in one state: at rest, or in a pose.
class BaseState {
 public:
  using Faces = std::span<const std::array<std::uint32_t, 3>>;
  /// Both must outlive it. Normals are the sum of those of the faces around, weighted by their angles.
  BaseState(std::span<const Double3> position, Faces faces);
  [[nodiscard]] std::span<const Double3> position() const { return position_; }
  [[nodiscard]] Faces faces() const { return faces_; }
  [[nodiscard]] std::span<const Double3> normal() const { return normal_; }
  /// The point on the surface and the unit normal there; the face's where corners' cancel, zero without any.
  Double3 at(std::uint32_t face, double u, double v, Double3& normal) const;
  [[nodiscard]] Double3 decode(const NormalDisplacement& d, const TangentRest* rest) const;

 private:
  std::span<const Double3> position_;
  Faces faces_;
  std::vector<Double3> normal_;
};

class DisplacementEncoder {
 public:
  /// \param base  at rest; must outlive this \pre fewer than 2^31 faces, at least one
  explicit DisplacementEncoder(const BaseState& base);
  /// Thread-safe. \return p encoded; without a normal that leads there the closest point with a tangential rest
  /// \param diagonal  of the fine surface: decode() gives p back within 1e-6 of it
  NormalDisplacement encode(const Double3& p, double diagonal, TangentRest& rest) const;
  /// Upper bound of what it holds.
  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t faces) {
    return faces * (2 * ClosestFaces::bytes_per_face() + 12 + 48);
  }

 private:
  bool walk(const Double3& p, std::uint32_t& face, double& u, double& v) const;
  const BaseState* base_;
  ClosestFaces closest_;
  std::vector<std::array<std::uint32_t, 3>>
      beyond_;  ///< per face: the one across the edge opposite to each corner
};

}  // namespace tessera
