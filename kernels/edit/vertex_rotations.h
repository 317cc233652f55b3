/// \file vertex_rotations.h
/// Rotations of a base surface in a pose, per vertex: the polar factor of the deformation gradient. The gradient is a mean over
/// rings of faces, so that no tangent has to be chosen (thesis 5.3, local frames), and linear in the motion of the handles: the
/// gradients of all basis functions are found once, and a pose is sums of products and one polar factor a vertex.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// A rotation matrix, row-major.
using Rotation = std::array<double, 9>;
inline constexpr Rotation kIdentityRotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};

[[nodiscard]] inline Double3 rotated(const Rotation& r, const Double3& p) {
  return {r[0] * p[0] + r[1] * p[1] + r[2] * p[2], r[3] * p[0] + r[4] * p[1] + r[5] * p[2],
          r[6] * p[0] + r[7] * p[1] + r[8] * p[2]};
}

/// Columns of a solution and what they are of: `first` that stay in a pose, then four of each handle.
struct SolutionColumns {
  std::span<const double> values;  ///< n x width, interleaved
  std::size_t width = 0, first = 0;
  bool targets = false;  ///< columns 3 to 5 say where targets lead, 0 to 2 where they do not
};

/// Gradients of the columns at the active vertices, within the surface at rest, as means by area over a vertex's faces and six more
/// rings: what has shrunk to nothing turns as what it stands on.
/// \param rest    n, the smooth base
/// \param active  ascending
/// \return by four vertices, rotation_width() numbers of each beside each other; the last ones are filled up with zeros
[[nodiscard]] std::vector<float> rotation_columns(std::span<const Double3> rest,
                                                  std::span<const std::array<std::uint32_t, 3>> faces,
                                                  std::span<const std::int32_t> active,
                                                  const SolutionColumns& columns);

/// Numbers a vertex: the mean projection onto tangent planes, by 6; the gradient that targets add, by 9; 12 of each handle.
[[nodiscard]] constexpr std::size_t rotation_width(bool targets, std::size_t handles) {
  return 6 + (targets ? 9 : 0) + 12 * handles;
}

/// By how much the axes and the origin of a handle's frame move in a pose.
using FrameMotion = std::array<Double3, 4>;

/// Per active vertex the rotation nearest to the mean gradient (Higham 1986; where that is about to turn over, Horn 1987). Exactly
/// kIdentityRotation where nothing changes.
/// \param columns  of rotation_columns() \param count  active vertices
[[nodiscard]] std::vector<Rotation> vertex_rotations(std::span<const float> columns, std::size_t count,
                                                     bool targets, std::span<const FrameMotion> motion);

/// Per vertex the rotation that takes edges within three rings from `before` to `after`, in the sense of least squares: how
/// the surface turns, whatever turned it (Kabsch 1976).
[[nodiscard]] std::vector<Rotation> fitted_rotations(std::span<const Double3> before,
                                                     std::span<const Double3> after,
                                                     std::span<const std::array<std::uint32_t, 3>> faces);

}  // namespace tessera
