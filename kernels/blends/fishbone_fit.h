/// \file fishbone_fit.h
/// The fishbone of a blend: a spine along its middle, planes across it, and in each the flanks and the arc that the
/// surface has there. Spine and planes follow what was fitted and are fitted again, so an exact sweep is found exactly.
/// Ribs see all vertices beside them, not only where they cut faces, and what they find is smoothed along the spine: one
/// variable at a time, where noise would take two.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/blends/blend_curves.h"
#include "kernels/blends/rib_planes.h"
#include "kernels/blends/rib_profile.h"

namespace tessera {

/// A vertex beside a fishbone.
struct RibVertex {
  std::uint32_t vertex = 0;
  RibPosition position;
  ProfilePosition across;
};

struct Fishbone {
  RibPlanes planes;
  std::vector<RibProfile> profiles;  ///< per rib
  bool convex = false;
  bool straightened = false;  ///< ribs are tilted, as they would overlap
  double edge = 0.0;          ///< mean edge of the mesh around
  double flank = 0.0;         ///< how far beside the arc vertices were looked at
  double rms = 0.0;           ///< of the distances of vertices to their profiles

  /// As from rib to rib, at a fraction.
  [[nodiscard]] RibProfile profile_at(double rib) const;
  /// Keeps ribs first, first + 1, ... of them, `count` below all: then it is open. \pre count >= 3
  void keep(std::size_t first, std::size_t count);
  double mean_radius() const;     ///< >= 0
  double mean_arc_angle() const;  ///< radians
  double mean_arc() const;
};

enum class FishboneOutcome { kFound, kTooShort, kNoFlanks, kRibsCross };

struct FishboneOptions {
  double spacing = 0.0;    ///< of ribs, > 0
  double edge = 0.0;       ///< mean edge of the mesh around, > 0
  double min_flank = 0.0;  ///< beside the arc: what an edit needs
  double min_seen = 0.0;   ///< beside the arc: vertices so far are looked at, at the least
};

/// Vertices near a fishbone with their places, by rib, then by vertex.
/// \param position, normal  of the mesh; \param radius  beside the arc  \param off  of the profile, at the most
[[nodiscard]] std::vector<RibVertex> locate_vertices(const Fishbone& bone, std::span<const Double3> position,
                                                     std::span<const Double3> normal, double radius,
                                                     double off);

/// \param position, normal  of the vertices of the mesh near the track; normals unit or zero
FishboneOutcome fit_fishbone(std::span<const Double3> position, std::span<const Double3> normal,
                             const BlendCurve& curve, const FishboneOptions& options, Fishbone& out);

}  // namespace tessera
