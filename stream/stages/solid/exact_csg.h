/// \file exact_csg.h
/// `csg --exact`: the meshes of a program are joined by their faces (exact_boolean.h), in memory, by one stage without tasks.
#pragma once
#include "stream/runtime/job.h"
#include "stream/stages/solid/csg_job.h"

namespace tessera {

/// The report's `mesh` has {vertices, faces, components, kept_faces, made_faces, made_vertices, cut_faces, face_pairs,
/// coplanar_pairs, ...}. Its stage throws InputError for a mesh that is no solid, naming what to do, EmptyError where nothing is
/// left, ValidationError where positions on a cut cannot be rounded so that no faces meet.
/// \throws UsageError  for options of the lattice, and for shapes in the program
JobDescription exact_csg_job(const CsgOptions& options);

}  // namespace tessera
