/// \file onto_stages.h
/// Stages of `deform --onto`: a mesh onto a scan of what was built after it. JobState::inputs are the mesh and the scans.
///
///   scan-cells  the scan near the mesh, summed up in planar cells
///   onto-fit    the smoothest displacement that brings the mesh there
///   write       the mesh's file from front to back, every vertex displaced
///   deviation   every point of the scan against the mesh as given and as written
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "stream/runtime/stage.h"
#include "stream/stages/deform/deform_options.h"

namespace tessera {

inline const std::string kScanCellsFile = "onto/cells.tsc", kLatticeFile = "onto/displacement.tsd";

std::vector<StageEntry> onto_stages(const DeformOptions& options);
/// Of all of them, by what the file says of itself.
std::vector<StageNeed> onto_needs(const JobState& state);
/// What a report says besides.
void summarise_onto(Json& report);

std::unique_ptr<Stage> make_scan_cells_stage(const JobState& state, const DeformOptions& options);
std::unique_ptr<Stage> make_onto_fit_stage(const JobState& state, const DeformOptions& options);
std::unique_ptr<Stage> make_onto_write_stage(const JobState& state, const DeformOptions& options);
std::unique_ptr<Stage> make_onto_deviation_stage(const JobState& state, const DeformOptions& options);

/// How far from the mesh points of the scan count. \param diagonal  of the mesh
double onto_distance(const DeformOptions& options, double diagonal);

// What stages take, told before there is a mesh, and reserved by the same functions.
std::uint64_t scan_cells_bytes();
std::uint64_t onto_fit_bytes(std::uint64_t cells, std::uint64_t fullest);
std::uint64_t onto_write_bytes(const JobState& state);
std::uint64_t onto_deviation_bytes(const RunOptions& run);

}  // namespace tessera
