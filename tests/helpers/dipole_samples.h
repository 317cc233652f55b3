/// \file dipole_samples.h
/// Area-weighted samples of spheres, queries around them, and what a tile would hold of either.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

#include "octree/multipole.h"
#include "octree/points.h"
#include "tests/helpers/oriented_samples.h"

namespace tessera::test {

inline constexpr double kPi = 3.14159265358979323846;

inline Int3 quantised(const Double3& p) {
  return {static_cast<int>(std::floor(p[0] * kQuantaPerCell + 0.5)),
          static_cast<int>(std::floor(p[1] * kQuantaPerCell + 0.5)),
          static_cast<int>(std::floor(p[2] * kQuantaPerCell + 0.5))};
}

inline bool before(const Int3& a, const Int3& b) {
  return cell_key(a, -kQuantumBits) < cell_key(b, -kQuantumBits);
}

/// Samples that all stand for the same area, canonical order.
inline std::vector<Dipole> dipoles_of(const Samples& samples, double area) {
  std::vector<Dipole> out;
  for (const Sample& s : samples) {
    Dipole d;
    d.q = quantised(s.p);
    for (std::size_t c = 0; c < 3; ++c) d.moment[c] = static_cast<float>(s.n[c] * area);
    out.push_back(d);
  }
  std::sort(out.begin(), out.end(), [](const Dipole& a, const Dipole& b) { return before(a.q, b.q); });
  return out;
}

inline std::vector<Dipole> sphere_dipoles(const Double3& centre, double radius, double spacing) {
  Random random(7);
  Samples samples;
  add_sphere(centre, radius, spacing, random, samples);
  return dipoles_of(samples, 4 * kPi * radius * radius / static_cast<double>(samples.size()));
}

inline std::vector<Int3> queries_around(const Double3& centre, double radius, std::size_t count) {
  Random random(11);
  std::vector<Int3> out;
  for (std::size_t i = 0; i < count; ++i) {
    Double3 p;
    for (std::size_t c = 0; c < 3; ++c) p[c] = centre[c] + radius * (2 * random.unit() - 1);
    out.push_back(quantised(p));
  }
  std::sort(out.begin(), out.end(), before);
  return out;
}

/// The part of the dipoles that a tile would hold: of the leaves within `leaves` of the box of bricks [low,
/// high).
struct Split {
  MultipoleTree far, near;
  Split(const std::vector<Dipole>& all, const Int3& low, const Int3& high)
      : far(global(all)), near(local(all, low, high)) {}

  static MultipoleTree global(const std::vector<Dipole>& all) {
    MultipoleTree whole(all, kLeafBits);
    return {whole.level(kBrickBits).cells, {}, kBrickBits};
  }
  static MultipoleTree local(const std::vector<Dipole>& all, const Int3& low, const Int3& high) {
    const MultipoleTree whole(all, kLeafBits);
    std::vector<Multipole> leaves;
    std::vector<Dipole> dipoles;
    const auto within = [&](const Int3& cell, int bits, int margin) {
      bool in = true;
      for (std::size_t c = 0; c < 3; ++c)
        in &= cell[c] >= (low[c] << (kBrickBits - bits)) - margin &&
              cell[c] < (high[c] << (kBrickBits - bits)) + margin;
      return in;
    };
    for (const Multipole& m : whole.level(kLeafBits).cells) {
      const auto at = morton_decode(m.key >> 9);
      if (within({static_cast<int>(at[0]), static_cast<int>(at[1]), static_cast<int>(at[2])}, kBrickBits, 1))
        leaves.push_back(m);
    }
    const int shift = kQuantumBits + kLeafBits;
    for (const Dipole& d : all)
      if (within({d.q[0] >> shift, d.q[1] >> shift, d.q[2] >> shift}, kLeafBits, 1)) dipoles.push_back(d);
    return {leaves, dipoles, kLeafBits, kBrickBits};
  }
};

}  // namespace tessera::test
