/// \file field_job.h
/// Meshes become a level set: signed distances at the nodes of a lattice near their surface, as an OpenVDB file.
#pragma once
#include <cstdint>

#include "stream/runtime/job.h"
#include "stream/runtime/option_table.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {

struct FieldJobOptions {
  double resolution = 0.0;
  double band = 3.0;         ///< cells on both sides of the surface
  std::uint64_t meshes = 1;  ///< how many inputs: part of the job, since its stages follow from it

  void validate() const {}
};
OptionTable option_table(FieldJobOptions& options);

/// Import of every input, lattice, lines, surface, distances, grid. The report's `field` has {leaves, nodes, bytes, h, ...}.
JobDescription field_job(const FieldJobOptions& options);

}  // namespace tessera
