/// \file point_store.h
/// Ordered points on disk: one file per bucket of consecutive bricks, canonical order inside, a table of
/// bricks and of the 8^3-cell blocks inside each. Bricks of all files together are in Morton order.
///
/// File, little endian: header (64 bytes, magic and version) | records of 24 bytes | block tables, 8 bytes
/// per occupied block | brick table, 56 bytes per brick | footer (64 bytes). XXH3 guards each brick's
/// records, each block table, the brick table and the footer, so that a damaged section is named when it is
/// read.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "octree/points.h"

namespace tessera {

class PointOverlay;

/// One brick of the store.
struct BrickEntry {
  std::uint64_t key = 0;  ///< Morton code of the brick
  std::uint64_t points = 0;
  std::uint32_t file = 0;    ///< index of the bucket file
  std::uint32_t blocks = 0;  ///< occupied 8^3-cell blocks
  std::uint64_t first = 0;   ///< index of its first point in the file
  std::uint64_t table = 0;   ///< byte offset of its block table in the file
};

/// Writes one bucket file, past the page cache. Memory: the buffer, 56 bytes a brick, 8 bytes an occupied
/// block.
class PointFileWriter {
 public:
  explicit PointFileWriter(const std::filesystem::path& path,
                           std::size_t buffer_bytes = std::size_t{4} << 20);
  ~PointFileWriter();
  PointFileWriter(const PointFileWriter&) = delete;
  PointFileWriter& operator=(const PointFileWriter&) = delete;
  /// Makes room for the tables of so many bricks and points at most, so that they never grow by doubling.
  void expect(std::uint64_t bricks, std::uint64_t points);
  /// \pre keys ascend; the points lie in the brick, at least one, in canonical order
  void brick(std::uint64_t key, std::span<const PointRecord> points);
  /// Tables, checksums, close (no sync, no rename: the task commits). Returns bytes written.
  std::uint64_t finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Every ordered point of a job. Thread-safe for reading; holds the brick table only (56 bytes a brick).
class PointStore {
 public:
  /// Opens the bucket files, in order. With an overlay, normals and outliers are what it says.
  /// \throws InputError naming the file when one is damaged
  explicit PointStore(const std::vector<std::filesystem::path>& files,
                      std::shared_ptr<const PointOverlay> overlay = nullptr);
  ~PointStore();

  std::span<const BrickEntry> bricks() const;  ///< ascending key
  const BrickEntry* find(std::uint64_t key) const;
  std::uint64_t point_count() const;

  /// Points of the box [origin - halo, origin + cells + halo), cells, canonical order, outliers skipped.
  /// \param with_sensor  fill PointBlock::sensor
  /// \pre cells + 2 halo below 2^14 per axis, so that positions are exact floats
  /// \cost about 40 bytes a point of memory, the result included
  PointBlock load(const Int3& origin_cells, const Int3& cells, int halo_cells,
                  bool with_sensor = false) const;
  /// Starts fetching what load() of this box will read, whole bricks at a time: halo shells are many small reads,
  /// and a disk serves them one by one.
  void prefetch(const Int3& origin_cells, const Int3& cells, int halo_cells) const;
  /// All records of one brick, canonical order, outliers included.
  std::vector<PointRecord> load_brick(const BrickEntry& brick) const;
  /// Upper bound of the points that load() would return, from the tables alone: exact but for halo blocks
  /// (8^3 cells), which count whole, and outliers.
  std::uint64_t count_bound(const Int3& origin_cells, const Int3& cells, int halo_cells) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
