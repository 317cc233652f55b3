/// \file import_bytes.h
/// What the stages of an import reserve, by what they work on: for them, and for forecasts of jobs that import.
#pragma once
#include <algorithm>
#include <cstdint>

#include "stream/files/direct_file.h"
#include "stream/import/import_plan.h"
#include "stream/runtime/stage.h"

namespace tessera {

inline constexpr std::uint64_t kImportDealBytes = std::uint64_t{32} << 20;  ///< open chunks while dealing out
inline constexpr std::uint64_t kImportSortBytes = std::uint64_t{16} << 20;

/// Of the reader: positions of a file that fits are kept between its two readings.
inline std::uint64_t import_keep_bytes(const RunOptions& run) {
  constexpr std::uint64_t kMinToKeep = std::uint64_t{256} << 20;
  return run.memory_bytes >= kMinToKeep ? run.memory_bytes / 8 : 0;
}
inline std::uint64_t import_read_bytes(const RunOptions& run) {
  return import_keep_bytes(run) + kImportDealBytes + ImportPlan::kSurveyBytes + DirectFile::kDefaultBuffer +
         (std::uint64_t{8} << 20);
}

/// \param vertices  of the bucket, with duplicates   \param record_bytes  of a vertex on its way
inline std::uint64_t import_vertices_task_bytes(std::uint64_t vertices, std::uint64_t record_bytes) {
  return vertices * (record_bytes + 16 + 24 + 4 + 8 + record_bytes) + DirectFile::kDefaultBuffer +
         (std::uint64_t{2} << 20);
}
inline constexpr std::uint64_t kImportVerticesFinishBytes = std::uint64_t{4} << 20;

/// Vertices whose numbers are held at once. \param vertices  of the file
inline std::uint64_t import_corner_range(const RunOptions& run, std::uint64_t vertices) {
  const std::uint64_t share = std::max<std::uint64_t>(run.memory_bytes / 8 * 3, std::uint64_t{1} << 20);
  return std::clamp<std::uint64_t>(vertices, 1, share / sizeof(std::uint32_t));
}
inline std::uint64_t import_corners_bytes(const RunOptions& run, std::uint64_t vertices) {
  constexpr std::uint64_t kFixedBytes = std::uint64_t{24} << 20;  // reader, batches, output buffer
  return import_corner_range(run, vertices) * sizeof(std::uint32_t) + kImportDealBytes + kFixedBytes;
}

/// \param repair  repair_bytes(faces)
inline std::uint64_t import_tiles_task_bytes(std::uint64_t vertices, std::uint64_t faces,
                                             std::uint64_t repair) {
  return repair + faces * (12 + 12 + 12 + 6 + 1 + 16 + 24) + vertices * 120 + DirectFile::kDefaultBuffer +
         (std::uint64_t{6} << 20);
}
inline constexpr std::uint64_t kImportTilesFinishBytes =
    kImportSortBytes + DirectFile::kDefaultBuffer + (std::uint64_t{4} << 20);
inline std::uint64_t import_repair_task_bytes(std::uint64_t largest_patch_bytes) {
  return 2 * largest_patch_bytes + (std::uint64_t{8} << 20);
}

}  // namespace tessera
