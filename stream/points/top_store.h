/// \file top_store.h
/// The top surface of a scene seen from above on disk: its model by brick column and its samples by brick, one packed file
/// per task of the top stage.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <vector>

#include "kernels/points/surface_model.h"
#include "octree/points.h"
#include "stream/files/packed_file.h"

namespace tessera {

/// The lattice axes as one sees them from above.
struct ViewAxes {
  std::size_t u = 0, v = 1, up = 2;
  std::int32_t sign = 1;  ///< of up along its axis

  /// Up is the axis that comes closest to it. \param up  not zero
  static ViewAxes along(const Double3& up);
};

/// What the model says of one column of a brick column.
struct ModelColumn {
  std::int32_t height = kNoHeight;  ///< quanta along up from the lattice origin
  std::int32_t foot = kNoHeight;    ///< SurfaceModel::foot
  std::uint32_t reach = 0;          ///< SurfaceModel::reach
  std::uint8_t flags = 0;           ///< ModelFlag
  std::uint8_t unused[3] = {0, 0, 0};
};
static_assert(sizeof(ModelColumn) == 16);

/// One section of a top file.
struct TopEntry {
  std::uint64_t key = 0;       ///< of a brick; of a model that of the brick column at height 0
  std::uint32_t is_model = 0;  ///< kBrickCells^2 ModelColumn, u fastest; else samples as PointRecord
  std::uint32_t unused = 0;
  Section section;
};

class TopFileWriter {
 public:
  explicit TopFileWriter(const std::filesystem::path& path);
  void model(std::uint64_t key, const std::vector<ModelColumn>& columns);
  /// \pre at least one; in canonical order
  void samples(std::uint64_t key, const std::vector<PointRecord>& records);
  /// Returns bytes written.
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  void add(std::uint64_t key, bool is_model, std::span<const std::byte> bytes);
  PackedWriter file_;
  std::vector<TopEntry> table_;
};

/// All top files of a job; none at all where no top surface was made. Thread-safe for reading.
class TopStore {
 public:
  static constexpr const char* kFolder = "top";
  static constexpr const char* kExtension = ".tst";

  explicit TopStore(const std::filesystem::path& work);

  /// Bricks that hold samples, ascending key.
  const std::vector<std::uint64_t>& bricks() const { return bricks_; }
  std::uint64_t sample_count(std::uint64_t key) const;
  std::vector<PointRecord> samples(std::uint64_t key) const;
  /// Of the brick column with this key; empty where nothing stands in for the scan.
  std::vector<ModelColumn> model(std::uint64_t key) const;

 private:
  struct Place {
    std::size_t file;
    Section section;
  };
  std::vector<PackedFile> files_;
  std::map<std::uint64_t, Place> samples_, models_;
  std::vector<std::uint64_t> bricks_;
};

}  // namespace tessera
