/// \file vertices_back.h
/// Vertices that go back towards where they were before a mesh was smoothed, and how far.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "octree/vector.h"

namespace tessera {

/// One that a round found: its key, where smoothing left it, and where it was before.
struct VertexBack {
  std::uint64_t key = 0;
  Double3 at = {0, 0, 0}, given = {0, 0, 0};
};

class VerticesBack {
 public:
  VerticesBack() = default;
  /// Of these files, each of a round or of a part of one: what save() wrote.
  /// \param rounds  files of every round
  explicit VerticesBack(const std::vector<std::vector<std::filesystem::path>>& rounds);

  /// Ascending, no key twice; leaves it so. \returns bytes written
  static std::uint64_t save(const std::filesystem::path& path, std::vector<VertexBack>& found);

  /// Moves those of the block that go back. \param floats  positions stay floats
  /// \returns their numbers in the block, ascending, and where smoothing left them   \pre keys ascend
  std::vector<std::pair<std::uint32_t, Double3>> apply(MeshBlock& block, bool floats) const;

  bool empty() const { return keys_.empty(); }
  std::size_t size() const { return keys_.size(); }
  /// Where smoothing left the vertices of the last round.
  const std::vector<Double3>& last() const { return last_; }
  std::uint64_t bytes() const {
    return keys_.size() * (sizeof(std::uint64_t) + 1 + sizeof(Double3)) + last_.size() * sizeof(Double3);
  }

 private:
  std::vector<std::uint64_t> keys_;  ///< ascending
  std::vector<std::uint8_t> times_;  ///< in how many rounds each was found
  std::vector<Double3> given_;       ///< where each was before the mesh was smoothed
  std::vector<Double3> last_;
};

}  // namespace tessera
