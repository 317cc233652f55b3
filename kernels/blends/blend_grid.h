/// \file blend_grid.h
/// The grid of samples that a fishbone leaves: ribs times rows, rows at equal arc lengths between trajectories. What the
/// surface has beside arcs and straight flanks may come along, averaged and smoothed along the trajectories, unless it is
/// no more than noise.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "kernels/blends/resample_blend.h"

namespace tessera {

struct BlendGrid {
  std::size_t ribs = 0, rows = 0;
  bool closed = false;
  std::vector<Double3> node;            ///< rib after rib, rows from left to right
  std::vector<double> extent;           ///< per rib: arc length from its middle, as it was, to its last row
  std::size_t first_arc = 0, arcs = 0;  ///< rows first_arc .. first_arc + arcs are on the new arc
  std::size_t first_whole = 0;          ///< ribs from here to as far from the end have the edit in full
  bool sharp = false;

  [[nodiscard]] std::size_t at(std::size_t rib, std::size_t row) const { return rib * rows + row; }
  /// Outward, if x grows to the right as one looks along the spine with the surface's outside up.
  [[nodiscard]] std::vector<std::array<std::uint32_t, 3>> faces() const;
  double radius_of_arcs() const;  ///< measured on the nodes where the edit is full; 0 without an arc
};

/// \param near     vertices beside the fishbone, by rib
/// \param follows  the surface where it is not quite arc and flanks
[[nodiscard]] BlendGrid make_blend_grid(const Fishbone& bone, const std::vector<RibVertex>& near,
                                        const BlendOptions& options, double spacing, bool follows);

/// How far from the corner of the flanks an edit needs them: beyond the arc that is there.
double flank_beyond(const Fishbone& bone, const BlendOptions& options, double spacing);

}  // namespace tessera
