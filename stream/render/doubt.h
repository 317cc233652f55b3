/// \file doubt.h
/// Where the sides of points were in doubt: OUT.uncertain.ply of a reconstruction, asked about places of its mesh.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "octree/lattice.h"

namespace tessera {

/// Colours of its points: r | g<<8 | b<<16 | a<<24.
inline constexpr std::uint32_t kDoubtfulPoint = 0xff2030e0u;  ///< red
inline constexpr std::uint32_t kDecidedPoint = 0xffb0b0b0u;

class Doubt {
 public:
  /// \param memory_bytes  that it may use; 0 = no cap
  /// \throws InputError no such file: no points, or points without these colours; ResourceError they do not fit
  Doubt(const std::filesystem::path& points, std::uint64_t memory_bytes);
  /// Whether the nearest of the points is in doubt. \param p  finite, frame of the scan
  bool at(const Double3& p) const;
  std::uint64_t bytes() const { return bytes_; }

 private:
  ClosestFaces index_;  ///< the points as triangles of one corner
  std::vector<std::uint8_t> doubtful_;
  std::uint64_t bytes_ = 0;
};

}  // namespace tessera
