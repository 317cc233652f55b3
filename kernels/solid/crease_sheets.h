/// \file crease_sheets.h
/// The smooth sheets of a mesh that meet at each vertex of a crease: what a mitred offset is measured to instead of the vertex.
#pragma once
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

class CreaseSheets {
 public:
  CreaseSheets() = default;
  /// Faces of two rings around a vertex whose normals open less than 25 degrees are one sheet, larger faces first; what has
  /// less than a fiftieth of their area is a sliver and tells nothing.
  /// \param block  positions whose differences are the same numbers in every block (quantise_cells)
  explicit CreaseSheets(const MeshBlock& block);

  /// Outward unit normals of the sheets at a vertex; none where there is but one.
  [[nodiscard]] std::span<const Double3> at(std::uint32_t vertex) const {
    return {normal_.data() + first_[vertex], normal_.data() + first_[vertex + 1]};
  }

  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t vertices, std::uint64_t faces) {
    return vertices * 8 + faces * 12 + vertices * 72;
  }

 private:
  std::vector<std::uint32_t> first_;
  std::vector<Double3> normal_;
};

}  // namespace tessera
