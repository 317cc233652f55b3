/// \file flipped_faces.h
/// Faces that lie turned over in the surface around them, as noise and careless smoothing leave them: their normal is
/// against the sum of the unit normals of all other faces at their corners.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block.h"

namespace tessera {

/// Nothing is known of faces that are not in the block.
/// \cost 24 bytes a vertex and a face
[[nodiscard]] std::uint64_t count_flipped_faces(const MeshBlock& block);

/// In a few rounds the vertices of such faces, later of those around them too, go towards the mean of their neighbours;
/// those on creases stay.
/// Right where kUnflipRings whole rings of right positions are in the block.
/// \param corners   the block's own
/// \param position  n, in place of the block's own
/// \cost 24 bytes a vertex and a face; one look at all faces, then at those near what moved
void unflip_faces(const MeshBlock& block, const FaceCorners& corners, std::vector<Double3>& position);
/// A round reads two rings, one that widens three.
inline constexpr int kUnflipRounds = 5, kUnflipPlainRounds = 4;
inline constexpr int kUnflipRings = 2 * kUnflipPlainRounds + 3 * (kUnflipRounds - kUnflipPlainRounds);

}  // namespace tessera
