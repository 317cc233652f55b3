/// \file make_block.h
/// A mesh of plain arrays becomes a block (mesh_block.h), for programs that have vertices and faces and no names for them.
#pragma once
#include <array>
#include <cstdint>
#include <span>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// The whole mesh in one block. Keys are the numbers of the vertices; edges of one face are where the surface ends, so no vertex is
/// locked to a neighbour that is missing. Canonical: vertices without a face are dropped, so number i is where key[.] == i.
/// \param vertices  n, scan units \param faces  m, counter-clockwise from outside, indices below n
/// \throws InputError  more than 2^32 - 1 vertices, an index beyond them, a face that repeats one, a position that is not finite,
///   an edge of more than two faces or of two of the same direction (mesh_repair.h mends those)
[[nodiscard]] MeshBlock make_block(std::span<const Double3> vertices,
                                   std::span<const std::array<std::uint32_t, 3>> faces);

}  // namespace tessera
