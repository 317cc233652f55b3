/// \file node_fit.h
/// Algebraic point set surface at the nodes of one leaf, one row of the leaf per register. Source: Guennebaud, Germann,
/// Gross, "Dynamic Sampling and Rendering of Algebraic Point Set Surfaces", 2008.
///
/// Where two scans of one side disagree by less than 0.8 radii the fit takes their mean: see kLayered. Where normals of
/// noisy samples contradict each other and there is no crease, a wider fit takes over: see smooth_rough.
///
/// Sums run over samples in canonical order; lanes are nodes, never terms: values are pure functions of the samples.
#pragma once
#include <array>
#include <cstdint>

#include "kernels/field/row_samples.h"
#include "kernels/field/sheets.h"

namespace tessera {

/// What the fit says about the nodes of a leaf; index x + 8 y + 64 z, bit x + 8 y of word z.
struct LeafFit {
  alignas(32) std::array<float, 512> value{};  ///< signed distance to the fitted sphere, cells
  alignas(32) std::array<std::array<float, 512>, 3> gradient{};  ///< unit, outward
  std::array<std::uint64_t, 8> valid{};  ///< enough samples, and the node's foot point lies among them
  /// Subset of valid: the node has sheets, value and gradient are theirs.
  std::array<std::uint64_t, 8> creased{};
  std::array<std::uint32_t, 8> first_sheets{};  ///< index of the sheets of the first such node of each word
  std::array<std::uint64_t, 8> few{};           ///< too few samples in a plane nearby
  std::array<std::uint64_t, 8> beyond{};        ///< at or beyond the end of the samples
  /// Among them those that a radius of 1, 1.5 and 2 may make valid: see choose_gaps().
  std::array<std::array<std::uint64_t, 8>, 3> gap{};
  /// Subset of valid: where the surface ends nearby, as RimNodes say in node order.
  std::array<std::uint64_t, 8> at_boundary{};
  std::array<std::uint32_t, 8> first_boundary{};  ///< index of the first BoundaryNode of each word
};

/// Where the surface ends, as seen from a node.
struct BoundaryNode {
  float depth = 0.0f;  ///< distance of the node's foot point from the border, cells, > 0 within the surface
  Float3 inward = {0, 0, 0};  ///< from the foot point to the middle of its samples, cells
};

/// Nodes of a leaf near the end of the surface; index as in LeafFit.
struct LeafBoundary {
  alignas(32) std::array<float, 512> depth{};
  alignas(32) std::array<std::array<float, 512>, 3> inward{};
  std::array<std::uint64_t, 8> nodes{};  ///< where the rest holds

  [[nodiscard]] BoundaryNode at(std::size_t node) const {
    return {depth[node], {inward[0][node], inward[1][node], inward[2][node]}};
  }
};

struct NodeFitOptions {
  float radius = 3.0f;  ///< cells; a multiple of 1/1024, so that comparing with it is exact
  /// Mean squared normal residual against the sphere from which sheets are tried.
  float max_residual = 4e-3f;
  /// Samples off the surface, with normals to match: clusters start from averaged normals. Else from single
  /// ones, which finds faces that barely reach in.
  bool noisy = false;
  bool firm_boundary = false;  ///< end the surface well among the samples instead of at the last ones
  SheetOptions sheets;
};

/// Farthest foot point from a node whose value is kept, cells: more than a cell's diagonal.
inline constexpr float kLargestValue = 2.0f;
/// Depth from which the end of the surface does not matter; and how far beyond it nodes are valid still, so that the
/// surface can be cut there: cells.
inline constexpr float kBoundaryDepth = 1.0f;
inline constexpr float kBorderDepth = 0.5f;  ///< where the border runs
inline constexpr float kBoundaryMargin = 0.8f;

/// Scratch that a caller keeps between leaves.
struct NodeFitScratch {
  SampleList slab, wide_samples;
  RowSamples row, coarse_row;
  LocalSamples local, coarse_local, requested;
  LeafBoundary boundary, wide_boundary;
  LeafFit wide;  ///< of nodes in layers, gaps or rough places
  /// Of the leaf fitted last, noisy samples: smooth valid nodes whose normals contradict each other, and by how much:
  /// the mean squared residual of the normals against the sphere.
  std::array<std::uint64_t, 8> rough{};
  alignas(32) std::array<float, 512> roughness{};
};

/// \param samples  all samples within the radius of the nodes, relative to the leaf
/// \param coarse   mean normals (see average_normals) within the radius of the nodes
/// \param sheets   sheets of creased nodes are appended in node order
/// \post  scratch.rim tells which nodes are near the end of the surface
void fit_nodes(const SampleList& samples, const SampleList& coarse, const std::array<std::uint64_t, 8>& nodes,
               const NodeFitOptions& options, NodeFitScratch& scratch, LeafFit& out,
               std::vector<Sheets>& sheets);

/// Largest radius to which the support grows where samples are sparse, cells: what the halo holds.
inline constexpr float kMaxRadius = 6.0f;

/// 1.5 radii, at most kMaxRadius.
[[nodiscard]] float rough_radius(const NodeFitOptions& options);

/// Fits the rough nodes (scratch.rough) anew with that radius and blends by roughness, so that silhouettes of single scans
/// and scans that disagree come out smooth; no border moves.
/// \param samples  within rough_radius of the rough nodes
void smooth_rough(const SampleList& samples, const NodeFitOptions& options, NodeFitScratch& scratch,
                  LeafFit& fit);

/// Chooses the nodes at which the radius may grow with the spacing of the samples: of 1, 1.5 and 2 radii, at most
/// kMaxRadius, the least within which samples lie in `kGapBlocks` blocks of 2^3 cells, if their plane is near.
/// \param coarse  mean normals within kMaxRadius of the nodes that are few or beyond
/// \returns whether there are any
bool choose_gaps(const SampleList& coarse, const NodeFitOptions& options, NodeFitScratch& scratch,
                 LeafFit& fit);

/// Fits the chosen nodes with their radius. A node becomes valid and lies within the border if the samples surround its
/// foot point, one of them nearby (rim_rule.h): so gaps close that are not much wider than the samples around them lie
/// apart, and no border moves.
/// \param samples  within kMaxRadius of the chosen nodes
void bridge_gaps(const SampleList& samples, const NodeFitOptions& options, NodeFitScratch& scratch,
                 LeafFit& fit);

}  // namespace tessera
