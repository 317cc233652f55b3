/// \file face_corners.h
/// The faces at every vertex of a block, ascending.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// \cost 4 bytes a vertex and 12 bytes a face; one counting sort
class FaceCorners {
 public:
  /// \pre fewer than 2^30 faces
  explicit FaceCorners(const MeshBlock& block) : first_(block.position.size() + 1, 0) {
    for (const auto& face : block.faces)
      for (const std::uint32_t v : face) ++first_[v];
    std::uint32_t sum = 0;
    for (std::uint32_t& f : first_) {
      sum += f;
      f = sum;
    }
    corner_.resize(sum);
    for (std::size_t f = block.faces.size(); f-- > 0;)
      for (std::uint32_t k = 3; k-- > 0;)
        corner_[--first_[block.faces[f][k]]] = static_cast<std::uint32_t>(f << 2) | k;
  }

  /// face * 4 + corner of the vertex in it.
  std::span<const std::uint32_t> at(std::uint32_t vertex) const {
    return {corner_.data() + first_[vertex], corner_.data() + first_[vertex + 1]};
  }

 private:
  std::vector<std::uint32_t> first_;
  std::vector<std::uint32_t> corner_;
};

}  // namespace tessera
