/// \file run_file.h
/// What distribution leaves: points in runs, each run grouped by bucket. One packed file per task, one table of all
/// extents.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "octree/points.h"
#include "stream/files/packed_file.h"

namespace tessera {

/// The points of one bucket in one run.
struct Extent {
  std::uint32_t bucket = 0;
  std::uint32_t file = 0;
  Section records;
  std::uint64_t points() const { return records.bytes / sizeof(PointRecord); }
};
static_assert(sizeof(Extent) == 32);

/// Collects points with their buckets in a bounded buffer, writes a run whenever it is full.
class RunWriter {
 public:
  /// \param run_points  points per run; memory is kBytesPerPoint each plus the file's buffer
  RunWriter(const std::filesystem::path& path, std::uint32_t file, std::size_t buckets,
            std::size_t run_points);
  void add(const PointRecord& point, std::uint32_t bucket) {
    points_.push_back(point);
    buckets_.push_back(bucket);
    if (points_.size() == run_points_) flush();
  }
  /// Last run, table. Returns bytes written.
  std::uint64_t finish();

  static constexpr std::uint64_t kBytesPerPoint = 2 * sizeof(PointRecord) + 4;

 private:
  void flush();

  PackedWriter out_;
  std::uint32_t file_;
  std::size_t run_points_;
  std::vector<PointRecord> points_, grouped_;
  std::vector<std::uint32_t> buckets_;
  std::vector<std::uint64_t> first_;  ///< per bucket, of the run at hand
  std::vector<Extent> extents_;
};

/// A run file: its table are the extents. \throws InputError naming the file when it is damaged
PackedFile open_run_file(const std::filesystem::path& path);

/// The extents of all files, by bucket, file, offset; written by one task, read by many.
void save_extents(const std::filesystem::path& path, std::vector<Extent> extents);
std::vector<Extent> load_extents(const std::filesystem::path& path);
/// Extents [first, first + count) of a table that load_extents has checked.
std::vector<Extent> load_extents(const std::filesystem::path& path, std::uint64_t first, std::uint64_t count);

/// Records per chunk of stream_extent.
inline constexpr std::size_t kExtentChunk = 32768;

/// Streams the records of an extent in chunks. \throws InputError naming the file when it is damaged
template <typename Use>
void stream_extent(const PackedFile& file, const Extent& extent, std::vector<PointRecord>& buffer,
                   const Use& use) {
  SectionReader reader(file, extent.records);
  buffer.resize(kExtentChunk);
  while (reader.left() > 0) {
    const std::uint64_t part = std::min<std::uint64_t>(reader.left() / sizeof(PointRecord), kExtentChunk);
    reader.next(buffer.data(), part * sizeof(PointRecord));
    use(std::span<const PointRecord>(buffer.data(), static_cast<std::size_t>(part)));
  }
}

}  // namespace tessera
