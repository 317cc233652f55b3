/// \file coarser_fits.h
/// Fits of a lattice in which cells are twice as wide, where samples are too sparse for the one at work (sparse_nodes.h): so
/// a surface does not end where a brick with small cells has few samples, but where it would with large cells.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/field/band.h"
#include "kernels/field/node_fit.h"
#include "kernels/field/sparse_nodes.h"

namespace tessera {

/// Fits of the nodes of one block.
struct BandFits {
  Int3 origin{}, cells{};                ///< of the block
  std::vector<std::int32_t> leaf_index;  ///< as DirectedField has it
  std::vector<Int3> leaf;                ///< per fit: in leaves, relative to the block
  std::vector<LeafFit> fits;
  std::vector<BoundaryNode> boundaries;
  std::vector<Sheets> sheets;

  /// Of node (i, j, k), each within [-1, cells + 1]; null where the band is not.
  [[nodiscard]] const LeafFit* at(const Int3& node) const;
};

/// Appends the nodes of a leaf near the end of the surface.
void keep_boundaries(const LeafBoundary& boundary, LeafFit& fit, std::vector<BoundaryNode>& boundaries);

struct CoarserFits {
  SparseNodes sparse;  ///< of the block at work
  BandFits band;       ///< of places.origin() and places.cells(): valid nodes only where the places are
};

/// Adds the leaves of the block that coarser fits reach to the band, without any nodes; it stays in table order.
void add_coarser_leaves(const CoarserFits& coarser, const Int3& origin, const Int3& cells,
                        std::vector<BandNodes>& band);

/// Gives nodes of a leaf what the coarser fits say, where those reach farther: nodes within the surface keep their values,
/// near its end they pass over.
/// \param origin  of the block  \param leaf  in leaves  \param nodes  that may get a value
/// \param sheets  of the leaf are the last ones, and stay in node order
void fill_from_coarser(const CoarserFits& coarser, const Int3& origin, const Int3& leaf,
                       const std::array<std::uint64_t, 8>& nodes, LeafFit& fit, LeafBoundary& boundary,
                       std::vector<Sheets>& sheets);

}  // namespace tessera
