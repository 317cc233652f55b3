/// \file edit_basis.h
/// Poses of a base surface as a linear function of where its handles go: basis functions, computed once.
/// Source: Botsch, thesis 6.2.5. Every handle has an affine frame of four points; the vertices of its region are affine
/// combinations of them, and so is the whole solution: 3 columns for what is fixed, 4 for each handle.
///
/// The smooth base M is the surface of least energy between the regions as they are. Where M goes, the rest of the base
/// follows as a detail of M, turned as M turns (vertex_rotations.h).
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "kernels/edit/boundary_model.h"
#include "kernels/edit/vertex_rotations.h"
#include "octree/placement.h"

namespace tessera {

/// Roles of vertices; the others are numbers of handles.
inline constexpr std::int32_t kTargetVertex = -3, kSupportVertex = -2, kFixedVertex = -1;

/// 1 for vertices of the support.
[[nodiscard]] std::vector<std::uint8_t> support_flags(std::span<const std::int32_t> role);

/// What becomes of pieces of the support that touch neither what is fixed nor a handle.
enum class LoosePieces : std::uint8_t {
  kFollow,  ///< each moves, as an affine map, with the vertex nearest to it of all that is held
  kFix,     ///< they stay
  kRefuse,  ///< an error
};

/// A base surface and what is to happen to its vertices.
struct EditRegions {
  std::vector<std::int32_t> role;  ///< n: kSupportVertex, kFixedVertex or a handle
  std::vector<double> smoothness;  ///< n, read where not support: C^0 to C^(order-1)
  std::vector<std::string> handles;
  std::vector<Double3> target;  ///< n, read where the role is kTargetVertex: where they go; or empty
  /// n, or empty: where the smooth base has what is held, instead of where it is. Its roughness is then no condition.
  std::vector<Double3> fair{};
  LoosePieces loose = LoosePieces::kFollow;
};

struct EditBasis {
  std::vector<std::int32_t> role;    ///< n
  std::vector<std::int32_t> active;  ///< vertices of the support, ascending
  std::vector<Double3> centre;       ///< per handle: origin of its frame
  std::vector<double> radius;        ///< per handle: length of its axes
  /// Active x width(), interleaved: 3 of what is fixed, 3 of targets, 4 of each handle.
  std::vector<double> columns;
  std::vector<float> rotation_columns;  ///< of the active vertices (vertex_rotations.h)
  std::vector<Double3> target;          ///< as EditRegions has it
  [[nodiscard]] std::size_t first_handle() const { return target.empty() ? 3 : 6; }
  [[nodiscard]] std::size_t width() const { return first_handle() + 4 * centre.size(); }
};

struct EditBasisReport {
  BoundaryModelReport model;
  double energy = 0.0;  ///< of the smooth base at rest
  std::size_t loose_pieces = 0, loose_vertices = 0;
};

/// Solves for all columns at once.
/// \param metric  the surface, n vertices, that operators are of: the base itself, or a plane map of its support
/// \param base    n vertices
/// \throws InputError naming the loose piece of the support where all is loose, or by LoosePieces; SingularSystem naming
///         a place of the support; as BoundaryModel
EditBasis edit_basis(const TriangleSpan& base, const Laplacian& metric, const EditRegions& regions,
                     const BoundaryModelOptions& options, EditBasisReport& report);

/// The smooth base at rest.
[[nodiscard]] std::vector<Double3> rest_base(const EditBasis& basis, std::span<const Double3> position);

/// The smooth base when handle h moves by pose[h]: support from the columns, handles by their maps, targets where they shall
/// be, what is fixed where it is.
[[nodiscard]] std::vector<Double3> smooth_base(const EditBasis& basis, std::span<const Double3> position,
                                               std::span<const Placement> pose);

/// Per active vertex, how the base around it turns (vertex_rotations.h).
[[nodiscard]] std::vector<Rotation> pose_rotations(const EditBasis& basis, std::span<const Placement> pose);

/// Where the base goes: smooth base and turned details. Vertices that are fixed keep their bits; at the identity all do.
/// \param rotation  per active vertex: pose_rotations()
/// \param rest, posed  rest_base() and smooth_base()
[[nodiscard]] std::vector<Double3> posed_base(const EditBasis& basis, std::span<const Double3> position,
                                              std::span<const Rotation> rotation,
                                              std::span<const Double3> rest, std::span<const Double3> posed);

}  // namespace tessera
