/// \file edit_regions.h
/// Which vertices of a base surface a region of an edit takes.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "kernels/edit/edit_basis.h"

namespace tessera {

enum class RegionRole : std::uint8_t { kFixed, kSupport, kHandle };
enum class RegionShape : std::uint8_t {
  kAll,
  kBox,
  kSphere,
  kHalfSpace,
  kGeodesic,
  kPoints,
  kPainted,
  kPatch
};

struct EditRegion {
  RegionRole role = RegionRole::kFixed;
  std::string name;  ///< of a handle; regions of one name are one handle
  RegionShape shape = RegionShape::kAll;
  Double3 low = {0, 0, 0}, high = {0, 0, 0};  ///< box, closed
  Double3 point = {0, 0, 0};                  ///< sphere: centre; half-space: a point of its plane
  Double3 normal = {0, 0, 1};                 ///< half-space: out of what is taken, any length
  double radius = 0.0;           ///< sphere: radius; geodesic: largest distance along the surface
  std::vector<Double3> points;   ///< geodesic, patch: sources; points: the nearest vertex of each
  std::vector<Double3> targets;  ///< points of a handle without a map: where each goes; or empty
  std::array<int, 3> colour{};   ///< painted: red, green, blue
  int within = 0;                ///< painted: each of them may differ by so much
  double crease_deg = 0.0;       ///< patch: edges that turn by more bound it
  double smoothness = -1.0;      ///< of its boundary, C^0 to C^(order-1); below 0: the highest
};

/// What regions are of.
struct EditSurface {
  std::span<const Double3> position;  ///< n
  std::span<const std::array<std::uint32_t, 3>> faces;
  std::span<const Double3> sharp{};         ///< n: before it was smoothed, for creases; empty: as position
  std::span<const std::uint32_t> colour{};  ///< n: r | g << 8 | b << 16; empty: without
};

/// Regions in order, later ones take from earlier ones; what no region takes is fixed.
/// \param order  of the energy: the highest smoothness is order - 1
/// \throws InputError naming a region that takes no vertex, or is painted on a surface without colours
[[nodiscard]] EditRegions resolve_regions(std::span<const EditRegion> regions, const EditSurface& surface,
                                          int order);

/// 1 for the vertices of all faces that are reached from the faces nearest to some points without crossing an edge that turns by
/// more degrees, or at which not two faces meet.
[[nodiscard]] std::vector<std::uint8_t> crease_patch(std::span<const Double3> position,
                                                     std::span<const std::array<std::uint32_t, 3>> faces,
                                                     std::span<const Double3> sources, double crease_deg);

/// Distance along the surface from the vertices nearest to some points: shortest paths over edges and over the unfolded
/// diagonals of neighbouring faces, at most a tenth too long on even meshes. Infinite where nothing leads.
[[nodiscard]] std::vector<double> surface_distance(std::span<const Double3> position,
                                                   std::span<const std::array<std::uint32_t, 3>> faces,
                                                   std::span<const Double3> sources);
/// The same from vertices whose distance is given: every other one, infinite or too far, becomes what leads there.
void spread_distance(std::span<const Double3> position, std::span<const std::array<std::uint32_t, 3>> faces,
                     std::vector<double>& distance);

}  // namespace tessera
