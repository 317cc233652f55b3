/// \file point_summary.h
/// What one point file holds, found by reading all of it: fates, bounds, attributes, and how far its samples
/// are apart. The result does not depend on threads or slices.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/formats/points/point_source.h"

namespace tessera {

struct PointSummary {
  PointFileInfo info;
  ReadCounts counts;                  ///< sums over the file; warnings of reading
  std::uint64_t missing = 0;          ///< declared, not there
  std::uint64_t not_finite = 0;       ///< points with a coordinate that is NaN or infinite
  std::uint64_t without_normal = 0;   ///< of files with normals: zero or not finite
  std::uint64_t without_colour = 0;   ///< of files with colours
  Double3 min{}, max{};               ///< of the finite points; min > max if there are none
  bool exact_in_float = true;         ///< every coordinate is a float
  double spacing = 0.0;               ///< about, scan units; 0 = unknown. See below
  std::vector<std::string> warnings;  ///< of the header and of reading, claims refuted, one sentence each
};

/// The box of the finite points of several files, and how many these are.
struct SummedBounds {
  Double3 min{}, max{};
  std::uint64_t finite = 0;

  void add(const PointSummary& file) {
    const std::uint64_t more = file.counts.points - file.not_finite;
    for (std::size_t a = 0; a < 3 && more > 0; ++a) {
      min[a] = finite == 0 ? file.min[a] : std::min(min[a], file.min[a]);
      max[a] = finite == 0 ? file.max[a] : std::max(max[a], file.max[a]);
    }
    finite += more;
  }
};

/// Reads the file once, plus a few samples before, on the threads of the enclosing WorkerPool. Memory is bounded: about
/// 4 MiB per thread.
/// The spacing is the median over at most 64 points, spread evenly over the file, of the distance to their
/// fourth nearest point (which is 1 spacing on a square grid and 1.09 for random samples of a surface),
/// coincident ones left out. Overlapping scans make it smaller than that of one scan. \throws InputError as
/// open_point_file and PointFile::read do; StoppedError on a signal
PointSummary summarize_points(const std::filesystem::path& path, const ReadOptions& options);

}  // namespace tessera
