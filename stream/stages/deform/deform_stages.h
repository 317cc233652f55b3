/// \file deform_stages.h
/// Stages of an edit, after those of import and decimation.
///
///   shape  how large the imported mesh is and how even its faces: whether it may be its own base
///   base   the imported mesh, or what decimation left of it, remeshed: the base surface, in core
///   basis  regions, the system, its basis functions
///   write  the pose of the base; then the mesh's file once more from front to back: every vertex follows the base. Or
///          (prepare) where every vertex stands over the base
#pragma once
#include <memory>
#include <vector>

#include "kernels/smooth/smooth.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"
#include "stream/stages/deform/deform_options.h"

namespace tessera {

inline const std::string kDeformImport = "mesh";
inline const std::string kShapeFile = "shape/shape.json", kBaseFile = "base/base.tsb",
                         kBasisFile = "basis/basis.tsb";

/// Waves below some six edges of a base are left to the details (thesis 5.2).
const std::vector<SmoothRound>& base_low_pass();

/// A mesh with more of its area in thin faces (thin_faces.h) is no base.
inline constexpr double kMaxThin = 0.1;

/// Whether the imported mesh is small and even enough to be its own base. \pre the shape stage is done
bool is_own_base(const JobState& state);

std::unique_ptr<Stage> make_shape_stage(const JobState& state, const DeformOptions& options);

/// \param reduced  what decimation left; called where the mesh is not its own base
std::unique_ptr<Stage> make_base_stage(const JobState& state, const DeformOptions& options,
                                       const std::function<MeshStore(const JobState&)>& reduced);
std::unique_ptr<Stage> make_basis_stage(const JobState& state, const DeformOptions& options);
/// Mode apply: JobState::inputs are the basis and its mesh.
std::unique_ptr<Stage> make_deform_write_stage(const JobState& state, const DeformOptions& options);

}  // namespace tessera
