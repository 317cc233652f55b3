/// \file patch_coding.h
/// The bytes of one compact patch of a mesh store (mesh_store.h): a third of the others, without losing a bit.
///
///   vertices  keys as differences, positions, classes in runs, colours
///   faces     corners as differences, flags in runs, bounds
///
/// Numbers are bytes of 7 bits, low first, the high bit set on all but the last. Positions are floats or doubles; where
/// keys are names on the lattice (patch_mesh.h) and positions follow from them, only the fraction along the vertex's
/// lattice edge (all three for a centre) is kept, in the fewest of 2, 3 or 4 bytes that give back the same bits. The few that
/// stand elsewhere (borders, beside nodes, outside of their cells) come first, as they are.
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"

namespace tessera {

struct MeshStoreInfo;

/// Appends to `out`. \pre block canonical
void encode_vertices(const MeshBlock& block, const MeshStoreInfo& info, std::vector<char>& out);
void encode_faces(const MeshBlock& block, std::vector<char>& out);

/// \param vertices, faces, bounds  what the patch holds
/// \return false where the bytes do not hold it
bool decode_vertices(std::span<const char> bytes, std::size_t vertices, const MeshStoreInfo& info,
                     MeshBlock& block);
bool decode_faces(std::span<const char> bytes, std::size_t faces, bool bounds, MeshBlock& block);

}  // namespace tessera
