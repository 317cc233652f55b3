/// \file face_corners.h
/// The faces at every vertex of a block, ascending.
#pragma once
#include <cstdint>
#include <span>

#include "kernels/mesh/mesh_block.h"
#include "octree/lists.h"

namespace tessera {

/// \cost 4 bytes a vertex and 12 bytes a face; one counting sort
class FaceCorners {
 public:
  /// \pre fewer than 2^30 faces
  explicit FaceCorners(const MeshBlock& block)
      : corners_(make_lists<std::uint32_t>(block.position.size(), [&](const auto& put) {
          for (std::size_t f = 0; f < block.faces.size(); ++f)
            for (std::uint32_t k = 0; k < 3; ++k)
              put(block.faces[f][k], static_cast<std::uint32_t>(f << 2) | k);
        })) {}

  /// face * 4 + corner of the vertex in it.
  [[nodiscard]] std::span<const std::uint32_t> at(std::uint32_t vertex) const { return corners_[vertex]; }

 private:
  Lists<std::uint32_t> corners_;
};

}  // namespace tessera
