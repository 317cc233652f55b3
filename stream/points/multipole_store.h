/// \file multipole_store.h
/// Multipoles of the oriented points on disk, by brick, and the global summary of the bricks in memory.
///
/// File, little endian: magic | leaves (120 bytes each) of brick after brick | brick table | footer. XXH3 guards each
/// brick's leaves and the table.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "octree/multipole.h"
#include "octree/points.h"

namespace tessera {

class MultipoleFileWriter {
 public:
  explicit MultipoleFileWriter(const std::filesystem::path& path);
  ~MultipoleFileWriter();
  MultipoleFileWriter(const MultipoleFileWriter&) = delete;
  MultipoleFileWriter& operator=(const MultipoleFileWriter&) = delete;
  /// Bricks in ascending order. \param leaves  ascending keys, at least one, all of the brick
  void brick(std::uint64_t key, const std::vector<Multipole>& leaves);
  /// Table, footer, close. Returns bytes written.
  std::uint64_t finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// All multipole files of a job. Thread-safe for reading.
class MultipoleStore {
 public:
  static constexpr const char* kFolder = "multipole";
  static constexpr const char* kExtension = ".tsq";
  /// Cells that points handed to near() must reach beyond the block.
  static constexpr int kHaloCells = 2 * kLeafCells;

  /// \throws InputError naming the file when one is damaged
  explicit MultipoleStore(const std::filesystem::path& work);
  ~MultipoleStore();

  /// Bricks and coarser: about 120 x 4/3 bytes a brick, 14 bytes per 1000 points.
  const MultipoleTree& far() const;
  /// Leaves of all bricks around a block and the dipoles around it: what nodes [-1, cells] of the block need.
  /// \param points  of the block, halo at least kHaloCells and a multiple of 8
  MultipoleTree near(const PointBlock& points) const;
  /// Upper bound of the memory of near(), without the dipoles.
  std::uint64_t near_bytes(const Int3& origin_cells, const Int3& cells) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
