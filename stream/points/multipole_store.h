/// \file multipole_store.h
/// Multipoles of the oriented points on disk, leaves by brick in packed files, and the global summary of the bricks in
/// memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "octree/multipole.h"
#include "octree/points.h"
#include "stream/files/packed_file.h"
#include "stream/points/point_store.h"

namespace tessera {

class MultipoleFileWriter {
 public:
  explicit MultipoleFileWriter(const std::filesystem::path& path);
  /// Bricks in ascending order. \param leaves  ascending keys, at least one, all of the brick
  void brick(const std::vector<Multipole>& leaves);
  /// Returns bytes written.
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  struct Entry {
    Section leaves;
    Multipole whole;
  };
  friend class MultipoleStore;
  PackedWriter file_;
  std::vector<Entry> table_;
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
  /// The same before there is a store, from the points that it will sum up: ascending key.
  static std::uint64_t near_bytes(std::span<const BrickEntry> bricks, const Int3& origin_cells,
                                  const Int3& cells);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
