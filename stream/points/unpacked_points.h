/// \file unpacked_points.h
/// Points of packed inputs (LAZ, text under gzip), unpacked once for all passes: one packed file a task. Positions that
/// are whole numbers of a step lie there as those, so a point of LAZ takes 19 bytes.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "stream/files/packed_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// A chunk of points as it was handed on.
struct UnpackedBlock {
  Section geometry;  ///< positions, normals, sensors, classes and returns
  Section colours;   ///< colours, intensities
  std::uint32_t file = 0;
  std::uint32_t points = 0;
  std::uint32_t content = 0;
  std::uint32_t bucket = 0;  ///< of points dealt to several
};
static_assert(sizeof(UnpackedBlock) == 64);

class UnpackedWriter {
 public:
  explicit UnpackedWriter(const std::filesystem::path& path);
  /// \param file  index of the input  \param grid  of its positions; those that do not lie on it are kept as they are
  void add(std::uint32_t file, const PositionGrid& grid, const PointChunk& chunk, std::uint32_t bucket = 0);
  /// Fates of all points of the task, table. Returns bytes written.
  std::uint64_t finish(const ReadCounts& counts);

  /// Memory beside that of the chunks.
  static constexpr std::uint64_t kBytes = DirectFile::kDefaultBuffer + (std::uint64_t{1} << 20);

 private:
  PackedWriter out_;
  std::vector<UnpackedBlock> blocks_;
  std::array<std::vector<std::int32_t>, 3> steps_;
};

/// One file, chunk by chunk. Thread-safe. \throws InputError naming the file when it is missing or damaged
class UnpackedFile {
 public:
  explicit UnpackedFile(const std::filesystem::path& path);
  const ReadCounts& counts() const { return counts_; }
  const std::vector<UnpackedBlock>& blocks() const { return blocks_; }
  /// \param colours  whether colours and intensities are wanted  \param grid  that the block was added with
  void read(const UnpackedBlock& block, bool colours, const PositionGrid& grid, PointChunk& chunk) const;

 private:
  PackedFile file_;
  ReadCounts counts_;
  std::vector<UnpackedBlock> blocks_;
};

/// Streams all chunks in the order in which they were added; returns the fates. \param grid_of  of input `file`
ReadCounts read_unpacked(const std::filesystem::path& path, bool colours,
                         const std::function<PositionGrid(std::uint32_t file)>& grid_of,
                         const std::function<void(std::uint32_t file, const PointChunk&)>& sink);

}  // namespace tessera
