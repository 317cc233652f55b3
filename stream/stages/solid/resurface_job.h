/// \file resurface_job.h
/// Dirty meshes become one closed manifold with their sharp edges.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "stream/runtime/job.h"
#include "stream/runtime/option_table.h"

namespace tessera {

struct SolidModel;  // solid_stages.h, which not every caller of a job need read

/// What every job that makes a surface of solids asks for.
struct SolidSurfaceOptions {
  double resolution = 0.0;
  std::string method = "emc";
  double feature_angle_deg = 25.0;
  std::uint64_t min_component = 1;
  double offset = 0.0;
  std::string corners = "round";
  double mitre_limit = 2.0;
  double shell = 0.0;
};
void add_surface_options(OptionTable& table, SolidSurfaceOptions& options);
void apply(const SolidSurfaceOptions& options, SolidModel& model);
/// All inputs, together one soup.
SolidModel model_of_soup(std::size_t meshes);

struct ResurfaceOptions : SolidSurfaceOptions {
  std::uint64_t meshes = 1;  ///< how many inputs: part of the job, since its stages follow from it

  void validate() const {}
};
OptionTable option_table(ResurfaceOptions& options);

/// Import of every input, lattice, lines, surface, weld, write. The report's `mesh` has {vertices, faces, components, ...}.
JobDescription resurface_job(const ResurfaceOptions& options);

/// The stages of any model, from import to its surface.
std::vector<StageEntry> solid_surface_stages(const SolidModel& model);
/// The stages of any model, from import to output. \param maker  "tessera resurface"
std::vector<StageEntry> solid_stages(const SolidModel& model, std::uint64_t min_component,
                                     const std::string& maker);
/// What the report says of such a job.
void summarise_solids(Json& report);

}  // namespace tessera
