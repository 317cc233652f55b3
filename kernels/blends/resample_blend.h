/// \file resample_blend.h
/// One blend of a mesh gets triangles that are aligned to it: the grid of a fishbone's ribs and trajectories replaces its
/// faces and is stitched to those around it. Or it becomes rounder, sharper, or another profile first.
/// Source: thesis 4.3.3, 4.3.4; Botsch, Kobbelt, "Resampling Feature and Blend Regions in Polygonal Meshes for Surface
/// Anti-Aliasing", 2001.
#pragma once
#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "kernels/blends/blend_curves.h"
#include "kernels/blends/normal_jumps.h"
#include "kernels/blends/rib_profile.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

enum class BlendEdit : std::uint8_t {
  kNone,     ///< the same shape, within the tolerance
  kRound,    ///< an arc of a radius between the flanks; 0: a sharp edge
  kProfile,  ///< another curve between the flanks
};

/// A knot of a profile: where the curve is, and which way it goes, in a frame in which the arc begins at (0, 0) and ends
/// at (1, 0), with y out of the surface. Cubic after Hermite between knots.
struct ProfileKnot {
  Double2 at{}, tangent{};
};

struct BlendOptions {
  double tolerance =
      0.0;  ///< scan units, > 0: of the distance both ways, certified, unless the blend is edited
  double spacing = 0.0;  ///< of ribs and of rows; 0 = the mean edge around
  BlendEdit edit = BlendEdit::kNone;
  double radius = 0.0;                 ///< of kRound
  std::vector<ProfileKnot> profile{};  ///< of kProfile: two knots at least
  bool float_positions = true;
  std::uint64_t first_key = 0;  ///< of new vertices: this, the next, ...; above all others
};

/// What became of a blend. All but kChanged leave it as it was.
enum class BlendOutcome : std::uint8_t {
  kChanged,
  kTooShort,         ///< fewer than four ribs
  kNoFlanks,         ///< beside the band the surface goes on bending: no rolling ball blend
  kSharp,            ///< a crease: its vertices lie on it already; only edits change it
  kRibsCross,        ///< the spine turns too sharply for ribs so wide
  kAtBorder,         ///< it reaches a border of the surface
  kNotStitched,      ///< some edge around it found nothing to be stitched to
  kFolds,            ///< a new face would turn away from the surface
  kBeyondTolerance,  ///< somewhere it would be farther from what it was
  kNoBetter,         ///< its normals vary no more than those of the grid would
};
[[nodiscard]] std::string_view sentence_of(BlendOutcome outcome);

struct BlendReport {
  BlendOutcome outcome = BlendOutcome::kTooShort;
  bool closed = false, convex = false, sharp = false, straightened = false;
  std::size_t ribs = 0, rows = 0;  ///< of the grid
  double length = 0.0;             ///< of the spine, scan units
  double radius = 0.0;             ///< as it was, in the mean; 0: a crease
  double new_radius = 0.0;         ///< as it is away from the ends of an edit, measured on the grid
  double arc_angle = 0.0;          ///< radians
  double rms = 0.0;                ///< of the vertices that were there against the fishbone
  double distance = 0.0;           ///< certified, both ways; 0 where nothing was changed
  std::size_t faces_removed = 0, faces_added = 0;
  NormalJumps before, after;
};

struct ResampledBlend {
  BlendReport report;
  std::vector<std::array<std::uint64_t, 3>> removed;  ///< keys of their vertices, ascending; ascending
  MeshBlock added;                                    ///< canonical: new faces with all their vertices
};

/// How far around a track its block must reach.
double blend_halo(const BlendCurve& curve, const BlendOptions& options, double edge);

/// \param block  canonical, the surface near the track
/// \param edge   mean edge of the mesh, > 0
/// \post  where the blend is changed: without the removed faces and with the added ones the block is a manifold where it
///        was one, its borders are the same, and no vertex that was there moves
[[nodiscard]] ResampledBlend resample_blend(const MeshBlock& block, const BlendCurve& curve,
                                            const BlendOptions& options, double edge);

/// Upper bound of what it allocates.
[[nodiscard]] std::uint64_t resample_blend_bytes(std::uint64_t vertices, std::uint64_t faces);

}  // namespace tessera
