/// \file zipper.h
/// Stitches pieces of a surface along their border polylines: the rest of meshes that were cut back and the strip that was
/// made between them.
/// Sources: thesis 3.1.1; Turk, Levoy, "Zippered Polygon Meshes from Range Images", 1994, of which the clipping is left
/// out: pieces end short of each other, and the gap is triangulated by constrained Delaunay triangles. So nothing is
/// intersected, no vertex is new, and originals stay as they are.
///
/// Passes: vertices at which borders touch lose their faces; crumbs go; every border edge takes the vertex across the gap
/// that it sees under the largest angle, best first; vertices where the new faces do not close lose them again.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// Pieces near the gap. Faces counter-clockwise from outside, edge-manifold, all with corners of their own.
struct ZipPieces {
  static constexpr std::uint8_t kEnds =
      1;  ///< times 2^k: the surface ends at edge k, nothing is to be stitched there
  static constexpr std::uint8_t kGoesOn = 8;     ///< times 2^k: faces that are not here follow at edge k
  static constexpr std::uint8_t kOriginal = 64;  ///< of an original, not of the strip
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint8_t> edges;  ///< per face
};

struct ZipReport {
  std::uint64_t removed = 0;     ///< faces
  std::uint64_t added = 0;       ///< faces
  std::uint64_t open_edges = 0;  ///< of originals: cut, but not stitched
  std::uint64_t pinched = 0;     ///< vertices left with two fans, by faces that are not here
};

struct Zipped {
  std::vector<std::uint8_t> removed;  ///< per face
  std::vector<std::array<std::uint32_t, 3>> added;
  ZipReport report;
};

/// \param gap  how far from an edge the vertex that it takes may be, beside what edges there are long
/// \post with what stays of the faces, what is added is edge-manifold and has no vertex with two fans more than there
///       were; a pure function of the pieces
[[nodiscard]] Zipped zip(const ZipPieces& pieces, double gap);

/// What it takes at most.
[[nodiscard]] constexpr std::uint64_t zip_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return vertices * 96 + faces * 400;
}

}  // namespace tessera
