/// \file mesh_scene.h
/// A triangle mesh as a scene: any mesh, closed or not, is a ground truth (thesis 3.1.1, virtual range scanning).
///
/// Rays are tested as Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", 2013, in double precision: none slips
/// through an edge or a vertex. Faces lie in Morton order under an implicit tree of boxes.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "kernels/scene/scene.h"

namespace tessera::synth {

/// \param faces  counter-clockwise from outside; a sensor sees both sides of a face, direct samples have its normal
/// \throws InputError when no face has an area, or one names a vertex that is not there or not finite
[[nodiscard]] std::unique_ptr<Scene> make_mesh_scene(std::string name, std::vector<Double3> vertices,
                                                     std::vector<std::array<std::uint32_t, 3>> faces);

/// Upper bound of its memory, what it is made from included.
[[nodiscard]] constexpr std::uint64_t mesh_scene_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return vertices * 48 + faces * (12 + 12 + 16 + 12);
}

}  // namespace tessera::synth
