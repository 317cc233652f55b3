/// \file collapse_legality.h
/// Whether a halfedge may collapse, as far as its star alone tells: connectivity, lines, and the new faces. What it does to other
/// parts of the surface is asked of CrossingGuard, how far it moves the surface of collapse_deviation.h.
#pragma once
#include <cstddef>
#include <cstdint>

#include "kernels/decimate/collapse_mesh.h"

namespace tessera {

/// Why an edit is not done.
enum class CollapseRefusal : std::uint8_t {
  kNone,
  kLink,
  kFold,
  kShape,
  kNormal,
  kColour,
  kTolerance,
  kCrossing
};

// The edge from the centre of a star to star.ring[at].
[[nodiscard]] inline bool is_border_spoke(const Star& star, std::size_t at) {
  return at == 0 || at == star.faces;
}
[[nodiscard]] inline bool is_crease_spoke(const CollapseMesh& mesh, const Star& star, std::size_t at) {
  return mesh.crease_edge(at < star.faces ? prev_corner(star.corner[at]) : next_corner(star.corner[at - 1]));
}

/// A vertex leaves a border along the border, a crease along the crease, and enters no pinched vertex.
[[nodiscard]] bool follows_lines(const CollapseMesh& mesh, std::uint32_t u, const Star& star, std::size_t at);

/// The link condition: the rings of both ends share the third corners of the two faces at the edge (one at a border) and nothing
/// else, so the surface stays a manifold; nothing that closes goes down to two faces, nor an ear that is all there is. No edge
/// between two locked vertices is made: another block might make it too.
/// (Dey, Edelsbrunner, Guha, Nekhayev: "Topology Preserving Edge Contraction", 1999.)
[[nodiscard]] bool is_collapse_ok(const CollapseMesh& mesh, const Star& star, std::size_t at);

/// The smallest mean ratio of the faces around the star with its centre at p; those at ring[left_out] do not count.
double min_mean_ratio_around(const CollapseMesh& mesh, const Star& star, const Double3& p,
                             std::size_t left_out);

/// kFold where a face turns too far against what it was, kShape where one gets thinner than `min_mean_ratio` and than all were.
[[nodiscard]] CollapseRefusal check_new_faces(const CollapseMesh& mesh, std::uint32_t u, const Star& star,
                                              std::size_t at, double min_mean_ratio);

}  // namespace tessera
