/// \file scene_solid.h
/// Solids bounded by trimmed planes and cylinders, with every crease and corner known exactly: cube, csg,
/// fandisk. Distances, normals, ray hits and creases are closed forms or safeguarded Newton to rounding.
#pragma once
#include <memory>

#include "kernels/scene/scene.h"

namespace tessera::synth {

/// Edge 2, centre at the origin, axis-parallel.
[[nodiscard]] std::unique_ptr<Scene> make_cube();
/// Block 2.4 x 2 x 1.6 with a cylinder along z standing out of it on both sides and a bore along x through
/// all.
[[nodiscard]] std::unique_ptr<Scene> make_csg();
/// Profile of lines and tangent arcs with a bore, extruded along z, cut by an oblique plane: planes and
/// cylinders that meet in straight, circular and elliptic creases, convex and concave, next to tangent joints
/// without one.
[[nodiscard]] std::unique_ptr<Scene> make_fandisk();

}  // namespace tessera::synth
