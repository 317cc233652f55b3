/// \file ground_store.h
/// What the ground stages know of a scene from above by brick column: the lowest heights of its cells, and the terrain that is
/// fitted to them. Packed files with one section a brick column, one per task; read from any thread.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <vector>

#include "kernels/points/terrain.h"
#include "stream/files/packed_file.h"

namespace tessera {

/// The section of one brick column.
struct GroundEntry {
  std::uint64_t key = 0;  ///< of the brick column, that of its brick at height 0
  Section section;
};

/// Files of one kind in one folder of a work directory. \tparam Record  trivially copyable
template <class Record>
class GroundFiles {
 public:
  GroundFiles(const std::vector<std::filesystem::path>& paths, const PackedKind& kind) {
    for (const std::filesystem::path& path : paths) {
      const PackedFile& file = files_.emplace_back(path, kind, sizeof(GroundEntry));
      for (const GroundEntry& e : file.table<GroundEntry>())
        if (!slots_.emplace(e.key, Slot{files_.size() - 1, e.section}).second)
          throw_out_of_order(path, e.key);
    }
  }
  /// Brick columns that have a section, ascending key.
  std::vector<std::uint64_t> keys() const {
    std::vector<std::uint64_t> keys;
    for (const auto& [key, slot] : slots_) keys.push_back(key);
    return keys;
  }
  bool has(std::uint64_t key) const { return slots_.count(key) > 0; }
  /// Empty without a section.
  std::vector<Record> load(std::uint64_t key) const {
    const auto found = slots_.find(key);
    if (found == slots_.end()) return {};
    return files_[found->second.file].template load<Record>(found->second.section);
  }
  /// Memory of the tables.
  static std::uint64_t bytes(std::uint64_t columns) { return columns * 2 * (sizeof(Slot) + 48); }

 private:
  struct Slot {
    std::size_t file;
    Section section;
  };
  std::vector<PackedFile> files_;
  std::map<std::uint64_t, Slot> slots_;
};

class GroundFileWriter {
 public:
  GroundFileWriter(const std::filesystem::path& path, const PackedKind& kind) : file_(path, kind) {}
  template <class Record>
  void column(std::uint64_t key, const std::vector<Record>& records) {
    table_.push_back({key, file_.append(bytes_of(records))});
  }
  /// Returns bytes written.
  std::uint64_t finish() { return file_.finish(table_); }

 private:
  PackedWriter file_;
  std::vector<GroundEntry> table_;
};

inline constexpr const char* kGroundCellFolder = "ground_cells";
inline constexpr const char* kGroundFolder = "ground";
inline constexpr const char* kGroundExtension = ".tsg";
inline constexpr PackedKind kGroundCellKind = {"TSGCELL1", "a file of lowest heights"};
inline constexpr PackedKind kGroundKind = {"TSGROUN1", "a file of the ground"};

/// The lowest heights of a job: of every brick column that has points, its cells, u fastest.
GroundFiles<TerrainCell> open_ground_cells(const std::filesystem::path& work);
/// The terrain of a job: of every brick column that has points or lies inside, its nodes as BrickTerrain takes them.
GroundFiles<TerrainNode> open_ground(const std::filesystem::path& work);

}  // namespace tessera
