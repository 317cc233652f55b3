/// \file field_job.h
/// Meshes become a level set: signed distances at the nodes of a lattice near their surface, as an OpenVDB file.
#pragma once
#include <cstdint>

#include "stream/runtime/job.h"
#include "stream/runtime/option_table.h"

namespace tessera {

struct FieldJobOptions {
  double resolution = 0.0;
  double band = 3.0;         ///< cells on both sides of the surface
  bool full = false;         ///< the whole box
  double tolerance = 0.0;    ///< units of the meshes: an octree
  std::uint64_t meshes = 1;  ///< how many inputs: part of the job, since its stages follow from it

  void validate() const {}
};
OptionTable option_table(FieldJobOptions& options);

/// Import of every input, lattice, lines, surface, distances, grid; with a tolerance cells, octree. The report's `field` has
/// {leaves, nodes, bytes, h, ...}, or {cells, cells_by_size, bytes, full_grid_bytes, worst_error, ...}.
JobDescription field_job(const FieldJobOptions& options);

}  // namespace tessera
