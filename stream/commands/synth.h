/// \file synth.h
/// The scanner simulator: samples a scene whose surface is known and writes scans, with the truth beside
/// them. Streams: memory does not depend on the number of points. Same options, same bytes, on any number of
/// threads.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// Everything that decides the bytes, except `threads`, `memory_bytes` and `force`.
struct SynthOptions {
  std::string scene = "terrain";  ///< a name, or the file of a mesh
  /// `surface`: direct, uniform in area; terrestrial, airborne, structured-light.
  std::string mode = "surface";
  std::uint64_t points = 1000000;  ///< exact in mode surface of scenes with a parametrisation, else aimed at
  double spacing = 0.0;            ///< mean sample spacing, scene units; > 0 replaces `points`
  double noise = 0.0;              ///< standard deviation along the normal (surface) or the ray (sensors)
  bool noise_in_spacings = false;  ///< `noise` counts in mean spacings instead of scene units
  /// Length over which noise is correlated, as that of dense matching is, scene units; every set-up has its own. 0 = none.
  double noise_length = 0.0;
  bool noise_length_in_spacings = false;  ///< it counts in mean spacings
  /// Share of points replaced by uniform ones in the box of the scene grown by a tenth.
  double outliers = 0.0;
  double flying = 0.1;   ///< sensors: share of range jumps that give a flying point
  double missing = 0.0;  ///< share of the surface that nobody saw: balls around spots far from each other
  int missing_spots = 3;
  int views = 0;         ///< sensors: number of set-ups; 0 = usual for sensor and scene
  bool normals = false;  ///< write exact normals
  bool colour = false;
  bool per_scan = false;          ///< one file per set-up: NAME_001.EXT, ...
  bool double_positions = false;  ///< PLY only; implied by a shift
  Double3 shift = {0, 0, 0};      ///< added to every coordinate (UTM-like frames)
  std::uint64_t seed = 1;
  int octaves = 0;                 ///< of the terrain; 0 = what the spacing resolves
  int threads = 0;                 ///< 0 = all cores
  std::uint64_t memory_bytes = 0;  ///< a mesh must fit in it; 0 = what the machine lets the process have
  bool force = false;              ///< replace files that are there
};

struct SynthReport {
  std::uint64_t points = 0;
  std::uint64_t outliers = 0;  ///< uniform ones
  std::uint64_t flying = 0;    ///< between two surfaces
  double area = 0.0;           ///< of the truth surface, scene units squared; 0 for sensors
  double spacing = 0.0;        ///< sqrt(area / points); sensors: median over the rays
  double noise = 0.0;          ///< standard deviation used, scene units
  double noise_length = 0.0;   ///< used, scene units
  double seconds = 0.0;
  std::vector<std::filesystem::path> files;
  /// Sidecar: OUT without extension + .truth.json if per scan, else OUT.truth.json.
  std::filesystem::path truth;
};

/// \throws UsageError for options that make no sense, naming the option; InputError when a scene's file is no mesh;
///         ResourceError when it does not fit, or the disk is full
SynthReport synthesize(const SynthOptions& options, const std::filesystem::path& output);

}  // namespace tessera
