/// \file edge_balance.h
/// Whether a mesh is closed, told from its faces in any order and in no memory: over all faces the edges that run from the lower to
/// the higher vertex count once, those that run back count off. What is left is a sum of hashes, 0 for closed meshes, and for others
/// by chance once in 2^64.
#pragma once
#include <algorithm>
#include <cstdint>

#include "stream/formats/meshes/mesh_io.h"

namespace tessera {

class EdgeBalance {
 public:
  void face(const MeshFace& f) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t from = f[k], to = f[(k + 1) % 3];
      if (from == to) continue;
      const std::uint64_t edge = mixed(mixed(std::min(from, to)) ^ std::max(from, to));
      sum_ += from < to ? edge : 0 - edge;
    }
  }
  /// Every edge has as many faces on one side as on the other.
  bool closed() const { return sum_ == 0; }

 private:
  /// Steele et al., "Fast Splittable Pseudorandom Number Generators", 2014.
  static std::uint64_t mixed(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15ULL;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
  }
  std::uint64_t sum_ = 0;
};

}  // namespace tessera
