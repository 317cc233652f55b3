/// \file scan_fit.h
/// A surface onto a scan of what was built after it: the smoothest displacement of space that brings it there, found by matching
/// the scan's planar cells with their feet on the surface again and again, long waves first. How short its waves may be is
/// decided by cells that take no part in the fit.
///
/// Sources: Amberg, Romdhani, Vetter, "Optimal step nonrigid ICP algorithms for surface registration", 2007 (stiff first);
/// Chen, Medioni, 1992 (planes); Beaton, Tukey, "The fitting of power series", 1974 (weights); Stone, "Cross-validatory choice
/// and assessment of statistical predictions", 1974.
#pragma once
#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "kernels/edit/displacement_lattice.h"
#include "kernels/edit/plane_cells.h"

namespace tessera {

/// Where the surface, as it is before the fit, is nearest to a point.
struct SurfaceFoot {
  bool found = false;   ///< something lies within the distance
  bool border = false;  ///< the surface ends there
  Double3 at{}, normal{};
};
using FootFinder =
    std::function<std::vector<SurfaceFoot>(std::span<const Double3> points, double max_distance)>;

struct ScanFitOptions {
  int order = 2;            ///< of the derivatives that cost
  double wavelength = 0.0;  ///< of the shortest waves, units of the surface; 0 = what held-out cells confirm
  double max_distance = 0.0;  ///< of a match, > 0
  double cell_edge = 0.0;     ///< of the cells, > 0
  Double3 low{}, high{};      ///< box of the surface, low < high
  std::function<void()> check_stop = [] {};
};

/// One scale of the fit. Means are over cells that the scale before or this one explains.
struct ScanFitScale {
  double wavelength = 0.0;
  double held_before = 0.0,
         held_after = 0.0;  ///< rms of cells that took no part, with the scale before and this one
  bool kept = false;
};

struct ScanFitReport {
  std::vector<ScanFitScale> scales;
  double wavelength = 0.0;  ///< of the shortest waves of the result
  double bound = 0.0;       ///< beyond it no cell counts
  // Cells by what became of them.
  std::size_t matched = 0, far = 0, disagreeing = 0, border = 0;
  double rms = 0.0;  ///< of the matched cells from the planes of the result
};

/// \returns the displacement, over the box
/// \throws EmptyError where no cell has a match; ValidationError where too few have one to tell anything
DisplacementLattice fit_scan(std::span<const PlaneCell> cells, const FootFinder& feet,
                             const ScanFitOptions& options, ScanFitReport& report);

/// Nodes of the finest lattice there is.
inline constexpr std::size_t kMaxFitNodes = std::size_t{1} << 18;
/// Upper bound of what it allocates, beside the cells and what the finder takes.
constexpr std::size_t scan_fit_bytes(std::size_t cells) {
  return cells * 320 + kMaxFitNodes * sizeof(Double3) * 16;
}

}  // namespace tessera
