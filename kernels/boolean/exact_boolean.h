/// \file exact_boolean.h
/// Union, intersection and difference of two solids by their faces: faces that the other surface does not meet stay as they are,
/// the others are cut along it. What lies where is decided exactly; positions on the cut are rounded once, when all is decided.
/// Source: Zhou, Grinspun, Zorin, Jacobson, "Mesh Arrangements for Solid Geometry", 2016; regularised: Requicha, "Representations
/// for Rigid Solids", 1980.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "kernels/boolean/mesh_cuts.h"

namespace tessera {

enum class BooleanJoin : std::uint8_t { kUnite, kIntersect, kSubtract };

struct BooleanStats {
  std::uint64_t face_pairs = 0;      ///< of faces of both that meet
  std::uint64_t coplanar_pairs = 0;  ///< of these, those that overlap in one plane
  std::uint64_t cut_faces = 0;       ///< of both, that were cut into several
  std::uint64_t kept_faces = 0;      ///< of the result, that are one of an input as it was
  std::uint64_t made_faces = 0;      ///< of the result, pieces of cut ones
  std::uint64_t made_vertices = 0;   ///< of the result, on the cut
  std::uint64_t split_vertices = 0;  ///< given twice or more, where the result touches itself in them
};

struct BooleanResult {
  SolidMesh
      mesh;  ///< every edge has two faces and every vertex one fan: what touches itself has points twice
  std::vector<std::uint8_t> made;  ///< of its vertices: 1 where rounding put it
  BooleanStats stats;
};

/// Vertices at one position become one, vertices without faces and faces of fewer than three vertices go, and both are in an order
/// that depends on positions alone.
[[nodiscard]] SolidMesh canonical_solid(const SolidMesh& mesh);

/// What keeps a canonical mesh from being a solid, in a few words; none if it is one: closed, nothing without area, no faces
/// that meet beyond what they share, outer surfaces outward, cavities inward, nothing in itself twice.
/// \cost block_contacts' and about 1 us a face
[[nodiscard]] std::optional<std::string> solid_fault(const SolidMesh& mesh);

/// \pre both canonical, and solids
[[nodiscard]] BooleanResult exact_boolean(const SolidMesh& first, const SolidMesh& second, BooleanJoin join);

/// Upper bound of what solid_fault() and exact_boolean() allocate, by the faces of both, beside what cuts take (400 bytes a
/// face of the cut).
[[nodiscard]] constexpr std::uint64_t exact_boolean_bytes(std::uint64_t faces) {
  return faces * 420 + (std::uint64_t{8} << 20);
}

}  // namespace tessera
