/// \file output_frame.h
/// How a reconstruction writes positions.
#pragma once
#include "kernels/mesh/patch_mesh.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/meshes/patch_store.h"
#include "stream/points/plan.h"
#include "stream/runtime/stage.h"
#include "stream/stages/weld/written_positions.h"

namespace tessera {

/// Largest coordinate, by its size, within a brick of the lattice, scan units.
double farthest_coordinate(const Lattice& lattice, const Int3& brick);

/// In floats where their rounding stays below a thousandth of the lattice spacing, otherwise in doubles, which formats of
/// floats hold from a local origin (surface_placement); from the lattice's origin with `--local-output`.
/// \param farthest  farthest_coordinate over all bricks of the mesh
MeshFrame output_frame(const JobState& state, const Plan& plan, double farthest);
/// The same for other jobs. \param local  as `--local-output` asks for
MeshFrame output_frame(const Plan& plan, double farthest, bool local);

/// How the output of a reconstruction holds its mesh, from the box of the plan: known before there is a surface.
MeshPlacement plan_placement(const JobState& state, const Plan& plan);
/// The same for bricks of a lattice, whatever that of the frame. \param fine  as of place_mesh
MeshPlacement brick_placement(const std::filesystem::path& output, const MeshFrame& frame,
                              const Lattice& lattice, const Int3& first, const Int3& last, double fine);
/// The frame and where positions lie in the output, of the patches of a job.
struct PatchFrame {
  MeshFrame frame;
  WrittenPositions written;
};
/// \param reconstructs  the job, so that its options tell of `--local-output`
PatchFrame patch_frame(const JobState& state, const Plan& plan, const PatchStore& store, bool reconstructs);
/// The positions alone, for the passes before the output is written.
WrittenBy written_by(bool reconstructs);

inline constexpr double kFineCells = 1e-3;  ///< of the lattice spacing: rounding that is no matter

}  // namespace tessera
