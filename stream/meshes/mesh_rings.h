/// \file mesh_rings.h
/// Rings of faces around vertices of a store, found from patch to patch over what they share, not by distance: long edges draw in
/// nothing but their own faces.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "kernels/mesh/mesh_block.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

struct MeshRings {
  MeshBlock block;  ///< canonical
  /// Per vertex: the first patch that has it. Right for the vertices that rings were asked around.
  std::vector<std::uint32_t> first_patch;
};

/// Every face that has a vertex less than `rings` edges away from one of these. The stars of all such vertices are whole.
/// \param patches  ascending   \param keys  of vertices of the patches; empty: all of them   \param rings  > 0
/// \param fits  whether a block of so many vertices and faces may be made; asked while it is looked for, too
/// \returns nothing where it would not fit
/// \throws InputError as MeshStore::load()
/// \cost every patch that has such a face is read twice or a few times; bytes: mesh_rings_bytes()
std::optional<MeshRings> load_rings(
    const MeshStore& store, std::span<const std::size_t> patches, std::span<const std::uint64_t> keys,
    int rings, const std::function<bool(std::uint64_t vertices, std::uint64_t faces)>& fits);

/// Bytes that load_rings() holds for a result of that size, the result included. \param patch_bytes  of the largest patch
std::uint64_t mesh_rings_bytes(std::uint64_t vertices, std::uint64_t faces, std::uint64_t patch_bytes);

}  // namespace tessera
