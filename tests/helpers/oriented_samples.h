/// \file oriented_samples.h
/// Exact (or noisy) oriented samples of known solids, and the blocks that kernels get of them.
#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "octree/points.h"
#include "tests/helpers/random.h"

namespace tessera::test {

/// Position in cells from the lattice origin (all coordinates positive), unit outward normal.
struct Sample {
  Double3 p = {0, 0, 0};
  Double3 n = {0, 0, 0};
  std::uint32_t rgba = 0;
};
using Samples = std::vector<Sample>;

/// Parallelogram corner + [0,1] u + [0,1] v on a jittered grid of the given spacing, all with normal n.
/// \param keep  drops samples for which it is false; may be empty
void add_face(const Double3& corner, const Double3& u, const Double3& v, const Double3& n, double spacing,
              const std::function<bool(const Double3&)>& keep, Random& random, Samples& out);
/// The six faces of an axis-aligned box.
void add_box(const Double3& low, const Double3& high, double spacing, Random& random, Samples& out);
/// Mantle of a cylinder along z; `outward` false points the normals at the axis (a bore).
void add_cylinder(const Double3& base, double radius, double height, double spacing, bool outward,
                  const std::function<bool(const Double3&)>& keep, Random& random, Samples& out);
/// Sphere on a jittered spiral.
void add_sphere(const Double3& centre, double radius, double spacing, Random& random, Samples& out);
/// Torus around z.
void add_torus(const Double3& centre, double ring, double tube, double spacing, Random& random, Samples& out);
/// Moves every sample along its normal by Gaussian noise.
void add_noise(double deviation, Random& random, Samples& samples);

/// What the point store would hand out: quantised, canonical order, halo included, normals through their
/// code. \param colour  fill PointBlock::rgba
PointBlock make_block(const Samples& samples, const Int3& origin, const Int3& cells, int halo,
                      bool colour = false);

}  // namespace tessera::test
