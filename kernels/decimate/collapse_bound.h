/// \file collapse_bound.h
/// How far the faces around a halfedge collapse may be from the reference afterwards: what they were off before, and what the
/// collapse moves. And the link of the collapse as loops that such a distance is measured over.
#pragma once
#include <array>
#include <cstdint>
#include <optional>

#include "kernels/decimate/collapse_deviation.h"
#include "kernels/decimate/collapse_mesh.h"

namespace tessera {

/// One loop around the star, or where its centre lies on a crease or border one for each side of that.
struct LinkSides {
  std::size_t count = 0;
  std::array<LinkLoop, 2> loop;
  std::array<std::size_t, 2> flat_edge{kNoFlatEdge, kNoFlatEdge};  ///< as fan_deviation()
};

/// Where the removed vertex comes to lie: in the face or on the edge of a, b, c; weights of a and b.
struct CollapseFoot {
  std::uint32_t a = 0, b = 0, c = 0;
  double wa = 0.0, wb = 0.0;
};
struct CollapseBound {
  float bound = 0.0f;  ///< CollapseFace::bound of the new faces
  CollapseFoot foot;
};

/// The largest bound of the faces of a star.
double max_face_bound(const CollapseMesh& mesh, const Star& star);

/// The link of a closed star as the only loop, from ring[at] on.
void lay_link(const CollapseMesh& mesh, const Star& star, std::size_t at, LinkSides& sides);

/// The bound after the collapse of u into star.ring[at]; nothing where it folds. \param[out] sides  the link
std::optional<CollapseBound> bound_by_sum(const CollapseMesh& mesh, std::uint32_t u, const Star& star,
                                          std::size_t at, LinkSides& sides);

/// The link of the edge from u to v = star.ring[at], the new place p of both its centre. \param other  star of v
/// \return false where a face folds or gets thinner than `min_mean_ratio`, or where there are too many
bool lay_edge_link(const CollapseMesh& mesh, const Star& star, std::size_t at, const Star& other,
                   const Double3& p, double min_mean_ratio, LinkLoop& loop);

}  // namespace tessera
