/// \file onto_files.h
/// What the stages of `deform --onto` hand on: the scan's planar cells, and the displacement that brings the mesh onto it.
#pragma once
#include <filesystem>
#include <vector>

#include "kernels/edit/displacement_lattice.h"
#include "kernels/edit/plane_cells.h"
#include "stream/stages/deform/deform_options.h"

namespace tessera {

struct ScanCells {
  double edge = 0.0;
  std::vector<PlaneCell> cells;
};
/// Returns bytes written.
std::uint64_t save_scan_cells(const std::filesystem::path& path, const ScanCells& cells);
/// \throws InputError for a file that is damaged
ScanCells load_scan_cells(const std::filesystem::path& path);

std::uint64_t save_lattice(const std::filesystem::path& path, const DisplacementLattice& lattice);
/// \throws InputError for a file that is damaged
DisplacementLattice load_lattice(const std::filesystem::path& path);

}  // namespace tessera
