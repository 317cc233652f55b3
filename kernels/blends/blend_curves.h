/// \file blend_curves.h
/// Bands of vertices that bend one way become tracks: the centre line of a blend, or the line of a crease.
///
/// Vertices that bend hang together along edges where they bend the same way about the same line (so two blends that
/// meet in a corner are two bands), and a band counts where some of it bends enough (hysteresis). Its middle is followed
/// both ways from its sharpest vertex, step by step: slices across the line of least curvature, each centred by what of
/// the band lies in it.
#pragma once
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// When a vertex belongs to a blend. Turns are of the surface within the ball that its bend was measured over.
struct BandOptions {
  double radius = 0.0;       ///< of that ball, > 0, scan units
  double min_angle = 0.2;    ///< radians: curvature across times radius
  double sure_angle = 0.4;   ///< a band has some that turn by so much
  double min_ratio = 0.35;   ///< curvature along over that across: above it a vertex bends both ways
  std::size_t min_sure = 8;  ///< vertices that turn so much
};

struct BandVertex {
  std::uint64_t key = 0;
  Double3 position{}, normal{}, along{};
  double across = 0.0;  ///< as CurvatureTensor
};
/// Whether a vertex with these curvatures belongs to a band.
[[nodiscard]] bool is_in_band(double across, double minimum, const BandOptions& options);

struct BlendCurve {
  /// In even steps, not quite on the surface; a closed one does not repeat the first.
  std::vector<Double3> centre;
  std::vector<Double3> normal;  ///< unit, of the surface there; zero where it is to be found
  bool closed = false;
  bool convex = false;
  double half_width = 0.0;  ///< of the band, in the mean
  std::uint64_t key = 0;    ///< of its sharpest vertex: its name
};

/// \param band   ascending keys
/// \param links  edges of the mesh between two of them, as indices, any order
/// \param step   of the tracks, > 0
/// \post  open ends stay clear of other tracks; ascending keys; a pure function of the arguments, links as a set
[[nodiscard]] std::vector<BlendCurve> trace_bands(
    std::span<const BandVertex> band, std::span<const std::pair<std::uint32_t, std::uint32_t>> links,
    const BandOptions& options, double step);

/// A track by hand: a smooth curve through picked points in even steps. The surface is found later.
/// \param points  two at least, all different \throws InputError
[[nodiscard]] BlendCurve curve_through(std::span<const Double3> points, bool closed, double step);

[[nodiscard]] constexpr std::uint64_t trace_bands_bytes(std::uint64_t vertices, std::uint64_t links) {
  return vertices * 200 + links * 16;
}

}  // namespace tessera
