/// \file triangle_quality.h
/// How near a mesh is to equilateral triangles of one size: sums of integers, so parts add up in any order.
#pragma once
#include <array>
#include <cstdint>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

struct TriangleQuality {
  static constexpr std::size_t kAngleBins = 180;  ///< of one degree
  static constexpr std::size_t kLengthBins =
      100;  ///< of 0.02 target lengths; the last one holds all that is longer
  static constexpr std::size_t kValenceBins = 16;

  std::array<std::uint64_t, kAngleBins> angles{};    ///< all three of every face
  std::array<std::uint64_t, kAngleBins> least{};     ///< the smallest of every face
  std::array<std::uint64_t, kLengthBins> lengths{};  ///< of the edges of every face: inner edges count twice
  std::array<std::uint64_t, kValenceBins> valences{};  ///< of vertices inside with complete stars
  std::uint64_t faces = 0;
  std::uint64_t angle_off = 0;      ///< sum of |angle - 60|, millidegrees
  std::uint64_t length_off = 0;     ///< sum of |length - target| in 1e-6 targets
  std::uint64_t area_off = 0;       ///< sum of |area - that of the target triangle| in 1e-6 of the latter
  std::uint64_t smallest = 180000;  ///< angle, millidegrees

  /// Adds all faces of a block. \param target  length of edges, > 0
  void add(const MeshBlock& block, double target);
  void merge(const TriangleQuality& other);
};

}  // namespace tessera
