/// \file closing_store.h
/// What closing keeps in the work directory: rims and signs of the local surface by brick (left by the rims stage),
/// and the closing cells by brick (left by the close stage). Both are packed files with one section a brick.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "kernels/closing/closing.h"
#include "stream/files/packed_file.h"

namespace tessera {

struct BrickSection {
  std::uint64_t key = 0;  ///< Morton code of the brick
  std::uint64_t offset = 0;
  std::uint64_t hash = 0;
  std::uint64_t count = 0;  ///< leaves
  std::uint64_t extra = 0;  ///< rim cells behind them

  Section section(std::size_t item_bytes) const {
    return {offset, count * item_bytes + extra * sizeof(Int3), hash};
  }
};

/// Writes sections in ascending order of bricks.
class BrickSectionWriter {
 public:
  explicit BrickSectionWriter(const std::filesystem::path& path);
  void signs(std::uint64_t key, const std::vector<BandSigns>& signs, const std::vector<Int3>& boundaries);
  void cells(std::uint64_t key, const std::vector<ClosingLeaf>& leaves);
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  PackedWriter file_;
  std::vector<BrickSection> table_;
};

/// Reads them. Holds the tables (40 bytes a brick). Thread-safe.
class BrickSectionStore {
 public:
  /// \throws InputError naming the file when one is damaged
  explicit BrickSectionStore(const std::vector<std::filesystem::path>& files);

  std::span<const BrickSection> bricks() const { return bricks_.entries(); }  ///< ascending key
  const BrickSection* find(const Int3& brick) const;
  /// Signs of the leaves that hold nodes [0, 64] of a brick.
  std::vector<BandSigns> signs_around(const Int3& brick) const;
  std::vector<Int3> boundaries(const BrickSection& brick) const;
  /// Closing cells of a block and of the leaves just below and above it.
  std::vector<ClosingLeaf> cells_around(const Int3& origin_cells, const Int3& cells) const;

 private:
  PackedTables<BrickSection> bricks_;
};

/// Files of the job's close stage; none in an open job.
std::vector<std::filesystem::path> closing_files(const std::filesystem::path& work);
inline constexpr const char* kClosingFile = "close/cells.tsc";

}  // namespace tessera
