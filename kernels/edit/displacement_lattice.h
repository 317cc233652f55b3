/// \file displacement_lattice.h
/// A smooth displacement of space: uniform cubic B-splines on a cubic lattice, twice continuously differentiable. It knows
/// nothing of the mesh that it moves, so that neither creases nor slivers nor the number of faces make a difference to it.
///
/// Source: Sederberg, Parry, "Free-form deformation of solid geometric models", 1986; refinement by knot insertion, as Lane,
/// Riesenfeld, "A theoretical development for the computer generation and display of piecewise polynomial surfaces", 1980.
#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "octree/vector.h"

namespace tessera {

struct DisplacementLattice {
  Double3 corner{};      ///< of the first cell that has all its nodes: node (1, 1, 1)
  double spacing = 1.0;  ///< of the nodes
  std::array<std::size_t, 3> nodes{};
  std::vector<Double3> coefficient;  ///< x runs first

  /// The lattice of zero displacement over a box. \pre low <= high, spacing > 0
  static DisplacementLattice over(const Double3& low, const Double3& high, double spacing);
  std::size_t node_count() const { return nodes[0] * nodes[1] * nodes[2]; }
  std::size_t index(std::size_t i, std::size_t j, std::size_t k) const {
    return i + nodes[0] * (j + nodes[1] * k);
  }

  /// The same displacement with nodes at half the spacing.
  DisplacementLattice refined() const;
  /// At a point; beyond the box that of the nearest point in it.
  Double3 at(const Double3& p) const;
  /// Its derivatives: [a] is by coordinate a.
  std::array<Double3, 3> derivatives(const Double3& p) const;
  /// The point that is moved to `moved`, by fixed-point iteration. \pre the displacement does not fold space
  Double3 origin_of(const Double3& moved) const;
};

/// The 64 nodes around a point, and their weights as products of one factor an axis.
struct LatticeStencil {
  std::array<std::size_t, 3> first{};
  std::array<std::array<double, 4>, 3> weight{};

  LatticeStencil(const DisplacementLattice& lattice, const Double3& p);
  /// visit(node, weight), in the order of the nodes
  template <class Visit>
  void for_each(const DisplacementLattice& lattice, const Visit& visit) const {
    for (std::size_t k = 0; k < 4; ++k)
      for (std::size_t j = 0; j < 4; ++j) {
        const double w = weight[2][k] * weight[1][j];
        const std::size_t row = lattice.index(first[0], first[1] + j, first[2] + k);
        for (std::size_t i = 0; i < 4; ++i) visit(row + i, w * weight[0][i]);
      }
  }
};

/// What refined() does to coefficients, by axis, and its transpose. \param nodes  of the coarse lattice
std::vector<Double3> refine_nodes(const std::vector<Double3>& coarse,
                                  const std::array<std::size_t, 3>& nodes);
std::vector<Double3> coarsen_nodes(const std::vector<Double3>& fine, const std::array<std::size_t, 3>& nodes);

}  // namespace tessera
