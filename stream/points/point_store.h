/// \file point_store.h
/// Ordered points on disk: one packed file per bucket of consecutive bricks, canonical order inside; per brick its
/// records and a table of its 8^3-cell blocks. Bricks of all files together are in Morton order.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "octree/points.h"
#include "stream/files/packed_file.h"

namespace tessera {

class PointOverlay;

/// Folders of a work directory.
inline constexpr const char* kScanPointFolder = "points";
inline constexpr const char* kSurfacePointFolder = "surface_points";
inline constexpr const char* kPointExtension = ".tsp";

/// Sample of the points on a surface beyond doubt: Int3 in quanta, canonical order of points.
inline constexpr const char* kSeenSampleFile = "seen/sample.bin";
/// Those of them on the ground, in jobs whose mesh is that alone: then they are what is held against it.
inline constexpr const char* kSeenGroundFile = "seen/ground.bin";

inline constexpr PackedKind kPointFile = {"TSPOINT2", "a point file"};

/// One brick of the store, as the table of its file has it.
struct BrickEntry {
  std::uint64_t key = 0;  ///< Morton code of the brick
  std::uint64_t points = 0;
  std::uint64_t offset = 0;  ///< of its records; its block table lies behind them
  std::uint64_t points_hash = 0;
  std::uint64_t blocks_hash = 0;
  std::uint64_t blocks = 0;  ///< occupied 8^3-cell blocks

  Section records() const { return {offset, points * sizeof(PointRecord), points_hash}; }
  Section block_table() const { return {offset + points * sizeof(PointRecord), blocks * 8, blocks_hash}; }
};

/// The brick of this key, null if there is none. \param bricks  ascending key
const BrickEntry* find_brick(std::span<const BrickEntry> bricks, std::uint64_t key);

/// Writes one bucket file. Memory: the buffer, 48 bytes a brick.
class PointFileWriter {
 public:
  explicit PointFileWriter(const std::filesystem::path& path,
                           std::size_t buffer_bytes = DirectFile::kDefaultBuffer);
  /// Makes room for so many bricks, so that the table never grows by doubling.
  void expect(std::uint64_t bricks) { table_.reserve(bricks); }
  /// \pre keys ascend; the points lie in the brick, at least one, in canonical order
  void brick(std::uint64_t key, std::span<const PointRecord> points);
  /// Returns bytes written.
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  PackedWriter file_;
  std::vector<BrickEntry> table_;
};

/// What is loaded of points beside their positions.
struct PointFields {
  bool normals = true;  ///< and colours
  bool sensor = false, flags = false;
};

/// Every ordered point of a job. Thread-safe for reading; holds the brick table only (48 bytes a brick).
class PointStore {
 public:
  /// Opens the bucket files, in order. With an overlay, normals and outliers are what it says.
  /// \throws InputError naming the file when one is damaged
  explicit PointStore(const std::vector<std::filesystem::path>& files,
                      std::shared_ptr<const PointOverlay> overlay = nullptr);
  /// The points that a work directory makes its surface of: those of the scan with their decided overlay, or where the
  /// top surface stands in for some of them, what the top-points stage has put together.
  static PointStore of_surface(const std::filesystem::path& work);
  PointStore(PointStore&&) noexcept;
  ~PointStore();

  std::span<const BrickEntry> bricks() const;  ///< ascending key
  const BrickEntry* find(std::uint64_t key) const;
  std::uint64_t point_count() const;
  bool has_bodies() const;  ///< points without normal are strewn ones, to get bodies around them
  std::size_t file_count() const;
  std::pair<std::size_t, std::size_t> file_range(std::size_t file) const;  ///< brick indices [first, last)

  /// All points of a brick as the overlay has them, outliers too.
  std::vector<PointRecord> records(std::size_t brick) const;
  /// One of them. \pre index below the brick's points
  PointRecord record(std::size_t brick, std::uint64_t index) const;
  /// Points of the box [origin - halo, origin + cells + halo), cells, canonical order, outliers skipped.
  /// \param fields  of PointBlock to be filled; flags also where samples of the top surface are among them
  /// \pre cells + 2 halo below 2^14 per axis, so that positions are exact floats
  /// \cost about 40 bytes a point of memory, the result included
  PointBlock load(const Int3& origin_cells, const Int3& cells, int halo_cells,
                  const PointFields& fields = {}) const;
  /// Starts fetching what load() of this box will read, whole bricks at a time: halo shells are many small reads,
  /// and a disk serves them one by one.
  void prefetch(const Int3& origin_cells, const Int3& cells, int halo_cells) const;
  /// Upper bound of the points that load() would return, from the tables alone: exact but for halo blocks
  /// (8^3 cells), which count whole, and outliers.
  std::uint64_t count_bound(const Int3& origin_cells, const Int3& cells, int halo_cells) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
