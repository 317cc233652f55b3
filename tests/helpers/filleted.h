/// \file filleted.h
/// Solids with fillets whose surfaces are known exactly, in irregular triangles with their vertices on them.
#pragma once
#include "kernels/mesh/mesh_block.h"

namespace tessera::test {

/// Two flanks joined by an arc, swept along a line or a circle.
struct Swept {
  double radius = 3.0;  ///< of the arc; 0: sharp
  bool convex = true;
  double arc_deg = 90.0;
  double flank = 12.0;   ///< length of each
  double length = 40.0;  ///< of the sweep, along its spine
  double sweep_radius =
      0.0;  ///< radius of the circle that it is swept along, to the middle of the arc; 0: straight
  bool closed = false;  ///< all around the circle; `length` does not count
  double edge = 1.0;    ///< about, of the triangles
  double jitter = 0.3;  ///< of it, along the surface: vertices stay on it
  double noise = 0.0;   ///< off the surface, standard deviation, scan units
  std::uint64_t seed = 1;
};
/// The spine runs along y (straight), or around z. Keys 10 i + 7, borders marked.
MeshBlock swept_block(const Swept& s);
/// Distance of a point to the arc's surface if it were complete, above 0 outside; for straight sweeps.
double off_arc(const Swept& s, const Double3& p);

/// Box of half size `half` with all edges rounded, corners parts of spheres; every side n x n squares before jitter.
MeshBlock filleted_box(double half, double radius, int n, double jitter, double noise, std::uint64_t seed);

}  // namespace tessera::test
