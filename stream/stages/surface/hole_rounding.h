/// \file hole_rounding.h
/// Where a filling meets the mesh at a sharp edge its rim gives way, with it the new vertices (kernels/smooth/crease_blunting.h).
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "stream/runtime/stage.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/weld/mesh_around.h"

namespace tessera {

/// Moves vertices of a rim and of its filling, no others. A vertex lies on one rim, so no two holes move the same.
/// \param loop     its positions move along
/// \param origin   of them, whole cells from the lattice origin
/// \param touching  faces of the mesh that meet the filling, those at its rim among them, as gather_near() finds them
/// \param filling  of the loop; its new vertices move along
/// \param moves    gets those of the rim
/// \returns false, and nothing moves, where nothing is sharp or faces would come to cross
bool round_rim(const NamedLoop& named, HoleLoop& loop, const Double3& origin, const PatchStore& store,
               const Numbering& numbering, MeshAround& around, std::span<const ContactFace> touching,
               HoleFilling& filling, std::vector<MovedRim>& moves);

/// Joins the moves of all batches: per brick, as PatchPositions reads them. \returns how many
std::uint64_t save_rim_moves(const std::filesystem::path& work, const PatchStore& store,
                             const Numbering& numbering, std::uint64_t sort_bytes, TaskContext& context);

}  // namespace tessera
