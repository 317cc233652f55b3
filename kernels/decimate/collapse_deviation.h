/// \file collapse_deviation.h
/// How far a halfedge collapse moves the surface: a bound of the distance between the star before and after,
/// both ways. Both stars are fans over the same link, so they are graphs over one polygon; their difference
/// along its normal is linear on the overlay of the two fans and largest at an overlay vertex.
#pragma once
#include <array>
#include <cstddef>

#include "kernels/decimate/collapse_mesh.h"
#include "octree/portable_math.h"

namespace tessera {

/// The link of one side of a star as a closed loop, counter-clockwise, from the vertex that takes over.
struct LinkLoop {
  std::size_t size = 0;
  std::uint64_t borders = 0, creases = 0;  ///< bit i: what the edge from at[i] to at[i + 1] is
  std::uint64_t ends = 0;                  ///< bit i: creases or borders run through at[i]
  std::array<Double3, kMaxRing + 2> at{};  ///< relative to the vertex that takes over: at[0] = 0

  void clear() { size = 0, borders = creases = ends = 0; }
};

inline constexpr std::size_t kNoFlatEdge = ~std::size_t{0};

/// The apex above the new fan: in the face of at[0], at[sector], at[sector + 1], with the weights of the latter two.
struct FanFoot {
  std::size_t sector = 1;
  double first = 0.0, second = 0.0;
};

/// \param apex       the removed vertex, or where the side ends on a crease or border its foot there, relative too
/// \param flat_edge  i: the apex lies on the edge from at[i] to at[i + 1]; kNoFlatEdge: inside
/// \param[out] deviation   every point of either fan lies within it of the other fan
/// \return false where one of the fans is no graph over the loop's polygon: the collapse would fold
bool fan_deviation(const LinkLoop& loop, const Double3& apex, std::size_t flat_edge, double& deviation,
                   FanFoot* foot = nullptr);

/// The same for two neighbouring stars that become one fan around a new place.
/// \param loop   at[0] = 0 the new place, then the link of both stars, counter-clockwise
/// \param u, v   the old centres, relative to the new place
/// \param first  u has the faces at the link edges 1 .. first, v those after it; at[1] and at[first + 1] see both
bool edge_deviation(const LinkLoop& loop, const Double3& u, const Double3& v, std::size_t first,
                    double& deviation);

}  // namespace tessera
