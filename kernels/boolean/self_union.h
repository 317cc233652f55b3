/// \file self_union.h
/// Closed surfaces that pass through themselves or each other become the boundary of what they hold: faces are cut along each other,
/// exactly, and those pieces stay that have nothing on the outside and solid on the inside by the winding number. Faces off the cut that
/// stay are as they were, and so are parts that meet nothing.
/// Sources: Zhou, Grinspun, Zorin, Jacobson, "Mesh Arrangements for Solid Geometry", 2016; regularised: Requicha, "Representations
/// for Rigid Solids", 1980.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "kernels/boolean/mesh_cuts.h"
#include "kernels/boolean/settle_rounding.h"

namespace tessera {

struct SelfUnionStats {
  std::uint64_t pairs = 0;           ///< of faces that meet beyond what they share
  std::uint64_t coplanar_pairs = 0;  ///< of these, those that overlap in one plane
  std::uint64_t cut_faces = 0;       ///< that were cut into several
  std::uint64_t inner_faces = 0;     ///< that lay within the solid, or twice, and went whole
  RoundingStats rounding;
};

struct SelfUnion {
  std::optional<std::string> fault;  ///< why there is none, in a few words; then all else is empty
  std::vector<std::uint8_t> gone;    ///< of the faces that were given: 1 = not in the result as it was
  struct Face {
    std::array<std::uint32_t, 3> corner;  ///< vertices given, and from their number on `fresh`
    std::uint32_t of = 0;                 ///< the face that it is a piece of
  };
  std::vector<Face> made;      ///< what is there beside the faces that stay
  std::vector<Double3> fresh;  ///< positions of new vertices
  SelfUnionStats stats;
};

/// \param mesh  vertices with different numbers at one position are kept apart where faces do not meet there. A mesh that is inside
///              out as a whole stays so
/// \param step  what positions of new vertices become; kFloat: those of the mesh are floats
/// \post without a fault: no faces meet beyond what they share, but in copies of a vertex or edge where the result touches itself; each
///       edge of a part that changed has two faces, each vertex one fan. Nothing is changed where nothing meets
/// \cost block_contacts' and about 1 us a face, 50 us a pair
[[nodiscard]] SelfUnion unite_self(const SolidMesh& mesh, PositionStep step);

/// Upper bound of what it allocates. \param pairs  of faces that meet
[[nodiscard]] constexpr std::uint64_t self_union_bytes(std::uint64_t faces, std::uint64_t pairs) {
  return faces * 520 + pairs * 8192 + (std::uint64_t{8} << 20);
}

}  // namespace tessera
