/// \file volumetric_points.h
/// Which points lie on a surface, and which are strewn through space: leaves, spray, people who passed. Source: Weinmann
/// et al., "Semantic Point Cloud Interpretation Based on Optimal Neighborhoods", 2015 (surface variation, smoothed).
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// The points of a brick. Positions in cells relative to the brick.
struct VolumetricInput {
  std::span<const Float3> position;
  std::span<const float> roughness;      ///< PointShape::roughness
  std::span<const std::uint16_t> flags;  ///< bits of PointFlag: echoes, ground; empty = unknown
};

/// 1 for every point that is strewn: not only is its own neighbourhood no plane, most of those around it are none
/// either, so that edges, corners and wires on a surface stay.
[[nodiscard]] std::vector<std::uint8_t> find_volumetric(const VolumetricInput& points);

/// 1 for every other point that lies among strewn ones: within 10 cells along every axis most points are. In crowns these are
/// flakes of leaves that happen to lie in a plane; where bodies stand for crowns, they are part of them.
/// \param volumetric  of find_volumetric()
[[nodiscard]] std::vector<std::uint8_t> find_among_volumetric(const VolumetricInput& points,
                                                              std::span<const std::uint8_t> volumetric);

}  // namespace tessera
