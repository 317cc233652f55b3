/// \file run_file.h
/// What distribution leaves: points in runs, each run grouped by bucket. One file per task, one table for
/// all.
///
/// File, little endian: header (64 bytes, magic and version) | records of 24 bytes | extents, 32 bytes each |
/// footer (32 bytes). An extent is the points of one bucket in one run, guarded by an XXH3.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "octree/points.h"
#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"

namespace tessera {

struct Extent {
  std::uint32_t bucket = 0;
  std::uint32_t file = 0;
  std::uint64_t offset = 0;  ///< byte offset of its first record
  std::uint64_t points = 0;
  std::uint64_t checksum = 0;
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
  /// Last run, table, footer. Returns bytes written.
  std::uint64_t finish();

  static constexpr std::uint64_t kBytesPerPoint = 2 * sizeof(PointRecord) + 4;

 private:
  void flush();

  DirectFile out_;
  std::uint32_t file_;
  std::size_t run_points_;
  std::vector<PointRecord> points_, grouped_;
  std::vector<std::uint32_t> buckets_;
  std::vector<std::uint64_t> first_;  ///< per bucket, of the run at hand
  std::vector<Extent> extents_;
};

/// The extents of one run file. \throws InputError naming the file when it is damaged
std::vector<Extent> read_extents(const std::filesystem::path& run_file);

/// The extents of all files, by bucket, file, offset; written by one task, read by many.
void save_extents(const std::filesystem::path& path, std::vector<Extent> extents);
std::vector<Extent> load_extents(const std::filesystem::path& path);
/// Extents [first, first + count) of a table that load_extents has checked.
std::vector<Extent> load_extents(const std::filesystem::path& path, std::uint64_t first, std::uint64_t count);

/// Streams the records of an extent in chunks, releasing pages behind itself.
/// \throws InputError naming the file when it is damaged
template <typename Use>
void stream_extent(const ReadFile& file, const Extent& extent, std::vector<PointRecord>& buffer,
                   const Use& use);

/// Records per chunk of stream_extent.
inline constexpr std::size_t kExtentChunk = 32768;

/// Incremental checksum, so that a chunk need not be a whole extent.
class ExtentCheck {
 public:
  ExtentCheck();
  ~ExtentCheck();
  ExtentCheck(const ExtentCheck&) = delete;
  ExtentCheck& operator=(const ExtentCheck&) = delete;
  void add(const void* data, std::size_t bytes);
  /// \throws InputError when what was added is not the extent
  void verify(const ReadFile& file, const Extent& extent) const;

 private:
  void* state_;
};

template <typename Use>
void stream_extent(const ReadFile& file, const Extent& extent, std::vector<PointRecord>& buffer,
                   const Use& use) {
  ExtentCheck check;
  buffer.resize(kExtentChunk);
  for (std::uint64_t done = 0; done < extent.points;) {
    const std::uint64_t part = std::min<std::uint64_t>(extent.points - done, kExtentChunk);
    const std::uint64_t at = extent.offset + done * sizeof(PointRecord);
    file.read_at(at, buffer.data(), part * sizeof(PointRecord));
    check.add(buffer.data(), part * sizeof(PointRecord));
    use(std::span<const PointRecord>(buffer.data(), static_cast<std::size_t>(part)));
    done += part;
  }
  check.verify(file, extent);
}

}  // namespace tessera
