/// \file border_moves.h
/// Where the stages "border", "blunt" and "holes" moved vertices, per patch.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "stream/files/packed_file.h"

namespace tessera {

struct MovedVertex {
  std::uint32_t vertex = 0;  ///< own vertex of the patch, islands that are dropped counted in
  Float3 to{};               ///< cells, relative to the brick's min corner
};

inline constexpr const char* kBorderFolder = "border";
inline constexpr const char* kBluntFolder = "blunt";
inline constexpr const char* kRimFolder = "rounded";

class BorderMovesWriter {
 public:
  explicit BorderMovesWriter(const std::filesystem::path& path);
  /// Bricks in ascending order. \param brick  Morton code
  void add(std::uint64_t brick, const std::vector<MovedVertex>& moves);
  /// Returns bytes written.
  std::uint64_t finish();

 private:
  struct Entry {
    std::uint64_t key = 0;  ///< of the brick
    Section moves;
  };
  friend class BorderMoves;
  PackedWriter file_;
  std::vector<Entry> table_;
};

/// Holds the tables only, 32 bytes a brick with a border.
class BorderMoves {
 public:
  /// Of a finished stage; of one that was not run nothing. \throws InputError naming the file when one is damaged
  /// \param folder  of the stage
  explicit BorderMoves(const std::filesystem::path& work, const char* folder = kBorderFolder);
  bool any(std::uint64_t brick) const { return tables_.find(brick) != nullptr; }
  /// \param position  of the patch's own vertices
  void apply(std::uint64_t brick, std::vector<Float3>& position) const;

 private:
  PackedTables<BorderMovesWriter::Entry> tables_;
};

std::string border_moves_file_name(std::size_t task, const char* folder = kBorderFolder);

}  // namespace tessera
