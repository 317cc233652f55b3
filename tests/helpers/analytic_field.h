/// \file analytic_field.h
/// Directed fields of any block with known truth: solids made of primitives, and pure noise.
/// All positions are global: cells from the lattice origin. The same node has the same bits in any block.
#pragma once
#include <cstdint>
#include <functional>

#include "kernels/field/directed_field.h"

namespace tessera::test {

/// Value (< 0 inside; exact distance for the primitives) and its gradient.
struct ShapeSample {
  double value;
  Double3 gradient;
};
using Shape = std::function<ShapeSample(const Double3&)>;

Shape half_space(const Double3& point, const Double3& outward);  ///< inside where outward.(x - point) < 0
Shape ball(const Double3& centre, double radius);
Shape cylinder(const Double3& point, const Double3& direction, double radius);  ///< infinite
Shape torus(const Double3& centre, double ring_radius, double tube_radius);     ///< around the z axis
Shape box(const Double3& min, const Double3& max);                              ///< six half spaces
Shape intersect(Shape a, Shape b);
Shape unite(Shape a, Shape b);
Shape subtract(Shape a, Shape b);  ///< a without b

struct AnalyticFieldOptions {
  double band_cells = 3.0;                 ///< nodes with |value| up to this are valid; 0 = all nodes
  std::function<bool(const Int3&)> valid;  ///< further restricts the nodes, if set
  std::function<std::uint32_t(const Double3&)> rgba;  ///< colour of roots, none if not set
};

/// Roots by bisection, t clamped to [1/64, 63/64] with the rest in `offset`.
DirectedField make_field(const Shape& shape, const Int3& origin, const Int3& cells,
                         const AnalyticFieldOptions& options = {});

/// Independent random values, roots and normals, every node valid with the given probability inside the box
/// of nodes [domain_min, domain_max], none outside.
struct NoiseOptions {
  std::uint64_t seed = 1;
  double valid_probability = 1.0;
  Int3 domain_min = {0, 0, 0};
  Int3 domain_max = {0, 0, 0};
  double inside_probability = 0.5;
};
DirectedField make_noise_field(const NoiseOptions& noise, const Int3& origin, const Int3& cells);

/// The field of what the three functions say of global nodes, and of edges from a node along an axis.
DirectedField build_field(const Int3& origin, const Int3& cells,
                          const std::function<double(const Int3&)>& value,
                          const std::function<bool(const Int3&, double value)>& valid,
                          const std::function<EdgeRoot(const Int3&, int axis)>& root);

/// A 64-bit hash of a node and a salt, for deterministic noise.
std::uint64_t node_hash(const Int3& node, std::uint64_t salt);

}  // namespace tessera::test
