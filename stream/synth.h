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

/// Everything that decides the bytes, except `threads`.
struct SynthOptions {
  std::string scene = "terrain";
  std::string mode = "surface";    ///< surface: direct, uniform in area; or a sensor
  std::uint64_t points = 1000000;  ///< exact in mode surface, aimed at by sensors
  double spacing = 0.0;            ///< mean sample spacing, scene units; > 0 replaces `points`
  double noise = 0.0;              ///< standard deviation along the normal (surface) or the ray (sensors)
  bool noise_in_spacings = false;  ///< `noise` counts in mean spacings instead of scene units
  double outliers =
      0.0;  ///< share of points replaced by uniform ones in the box of the scene grown by a tenth
  bool normals = false;  ///< write exact normals
  bool colour = false;
  bool double_positions = false;  ///< PLY only; implied by a shift
  Double3 shift = {0, 0, 0};      ///< added to every coordinate (UTM-like frames)
  std::uint64_t seed = 1;
  int octaves = 0;  ///< of the terrain; 0 = what the spacing resolves
  int threads = 0;  ///< 0 = all cores
};

struct SynthReport {
  std::uint64_t points = 0;
  std::uint64_t outliers = 0;
  double area = 0.0;     ///< of the truth surface, scene units squared
  double spacing = 0.0;  ///< sqrt(area / points)
  double noise = 0.0;    ///< standard deviation used, scene units
  double seconds = 0.0;
  std::vector<std::filesystem::path> files;
  std::filesystem::path truth;  ///< sidecar <output>.truth.json
};

/// \throws UsageError for options that make no sense, naming the option; ResourceError when the disk is full
SynthReport synthesize(const SynthOptions& options, const std::filesystem::path& output);

}  // namespace tessera
