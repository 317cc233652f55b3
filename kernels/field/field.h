/// \file field.h
/// Signed distance band and directed distances of oriented points, for one block.
/// Sources: Guennebaud, Germann, Gross, "Dynamic Sampling and Rendering of Algebraic Point Set Surfaces",
/// 2008 (node values on smooth stretches); Ohtake et al., "Multi-level Partition of Unity Implicits", 2003
/// (sharp local combination, see sheets.h); thesis 4.2.1 (directed distances).
///
/// Passes: index the points by leaf; choose the band's nodes (band.h); fit spheres to all nodes, eight at a
/// time (node_fit.h); where normals bend more than a sphere and noise explain, split the samples into sheets
/// and join these by minima and maxima (sheets.h); roots and normals on crossed edges from the fits at both
/// ends (edge_roots.h); colour (root_colour.h).
#pragma once
#include <functional>

#include "kernels/field/coarser_fits.h"
#include "kernels/field/directed_field.h"
#include "octree/points.h"

namespace tessera {

struct FieldOptions {
  double radius_cells = 3.0;  ///< support radius of a sample, in cells, within [1, 4]
  /// Normals of one neighbourhood that differ by more are two sheets of a feature.
  double feature_angle_deg = 25.0;
  double noise_cells = 0.0;    ///< standard deviation of the points along the normal, in cells; 0 = exact
  bool firm_boundary = false;  ///< end the surface well among the samples: what is beyond will be closed
  bool bodies = false;  ///< points without normal are strewn ones, with closed bodies around them: bodies.h
  std::function<void()>
      pause{};  ///< called for every leaf; what it throws ends the evaluation; empty = never
};

/// Noise up to which samples count as exact, cells: of others DirectedField::creased is told.
inline constexpr double kExactNoise = 0.03;

/// What `evaluate_field` reaches beyond the block's core: the points handed in must be complete within it: the
/// radius and the halo nodes, at least the 8 cells over which the closing of the band reaches a halo node.
[[nodiscard]] int field_halo_cells(const FieldOptions& options);

/// Evaluates the band of a block.
/// \param points  core and halo of the block, canonical order, oriented; points without normal are ignored, or bodies
/// \post every node value, sign and root is a pure function of the points within field_halo_cells - 1 of the
///       node: the same bits for any block that holds it
/// \param wanted  no others get values: the same bits for those; roots and borders for edges and cells of such
///                nodes alone; empty = all
/// \param coarser  of the same points on the lattice with cells of twice the edge, for places where samples are sparse: coarser_fits.h;
///                 null: none. Nodes are pure functions of what it saw, too
[[nodiscard]] DirectedField evaluate_field(const PointBlock& points, const FieldOptions& options,
                                           const NodeFilter& wanted = {},
                                           const CoarserFits* coarser = nullptr);

/// The fits behind that, for a finer lattice.
[[nodiscard]] BandFits fit_field(const PointBlock& points, const FieldOptions& options,
                                 const NodeFilter& wanted, const CoarserFits* coarser);

}  // namespace tessera
