/// \file output_frame.h
/// How a reconstruction writes positions.
#pragma once
#include "kernels/mesh/patch_mesh.h"
#include "stream/points/plan.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Largest coordinate, by its size, within a brick of the lattice, scan units.
double farthest_coordinate(const Lattice& lattice, const Int3& brick);

/// In floats where their rounding stays below a thousandth of the lattice spacing; otherwise in doubles where the format
/// of the output has them, else in floats from the lattice's origin, as with `--local-output`.
/// \param farthest  farthest_coordinate over all bricks of the mesh
MeshFrame output_frame(const JobState& state, const Plan& plan, double farthest);
/// The same for other jobs. \param local  as `--local-output` asks for
MeshFrame output_frame(const std::filesystem::path& output, const Plan& plan, double farthest, bool local);

}  // namespace tessera
