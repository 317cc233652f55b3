/// \file convert_points.h
/// Points of any number of files into one file, streaming. All attributes that the output can hold are kept,
/// in the order of the inputs; what is dropped is counted.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/formats/points/point_source.h"
#include "stream/points/reconstruct_options.h"

namespace tessera {

struct ConvertOptions {
  std::vector<std::string> columns;  ///< names of text columns
  bool force_double = false;         ///< PLY: double coordinates even if floats hold them exactly
  /// Step of LAS coordinates, scan units; 0 = the power of ten that uses 30 bits, between 1e-9 and 1e-3, larger only
  /// where the extent needs it.
  double las_scale = 0.0;
  /// What is left out: classes (none named = all stay), returns, bounds, clip_rings, resolution_limit.
  ReconstructOptions wanted;
  /// Work directory where stage "thin" has left what is wanted of the inputs; empty = they are read.
  std::filesystem::path thinned;
  int threads = 0;  ///< 0 = all cores
};

struct ConvertReport {
  std::uint64_t points = 0;      ///< written
  std::uint64_t not_finite = 0;  ///< left out
  std::uint64_t withheld = 0;
  std::uint64_t empty = 0;
  std::uint64_t missing = 0;
  std::uint64_t unwanted = 0;  ///< left out as asked: of other classes, of other returns, outside, thinned
  std::uint64_t bytes = 0;
  /// What the output cannot hold, one sentence each, and warnings of the inputs.
  std::vector<std::string> notes;
};

/// The options that PointFilter reads, such that it leaves no class out where none is named.
ReconstructOptions wanted_points(ReconstructOptions options);

/// Two passes: one to know bounds and attributes, one to write. The same bytes on any number of threads.
/// \throws InputError, UsageError (classes or returns that no input tells, unknown extension, output among the inputs), EmptyError when no finite point is left,
///   ResourceError when the disk is full
ConvertReport convert_points(const std::vector<std::filesystem::path>& inputs,
                             const std::filesystem::path& output, const ConvertOptions& options);

}  // namespace tessera
