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
  /// Faces within three cells of a vertex that are joined to it there, weighted by area and nearness, in groups whose normals
  /// open less than 25 degrees: those with a twelfth of the weight are sheets, what has less (slivers, chamfers of a corner) tells
  /// nothing. Means are taken again among faces within 12 degrees of them, so that such faces do not tilt them.
  /// \param block  in cells; positions whose differences are the same numbers in every block (quantise_cells)
  explicit CreaseSheets(const MeshBlock& block);

  /// Outward unit normals of the sheets at a vertex; none where there is but one.
  [[nodiscard]] std::span<const Double3> at(std::uint32_t vertex) const {
    return {normal_.data() + first_[vertex], normal_.data() + first_[vertex + 1]};
  }

  /// How far the sheets at a vertex go on: 1 where two of them open by 40 degrees or more, 0 up to 25 degrees, in between as much
  /// as keeps what is measured to them continuous where a crease runs out in a smooth face.
  [[nodiscard]] double share(std::uint32_t vertex) const { return share_[vertex]; }

  [[nodiscard]] static constexpr std::uint64_t bytes(std::uint64_t vertices, std::uint64_t faces) {
    return vertices * 92 + faces * 16;
  }

 private:
  std::vector<std::uint32_t> first_;
  std::vector<Double3> normal_;
  std::vector<float> share_;
};

}  // namespace tessera
