/// \file colour_stage.h
/// Colours of a decimated level: means over the area that each vertex stands for (kernels/decimate/mean_colours.h).
#pragma once
#include <cstdint>
#include <memory>

#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

inline constexpr const char* kColourFolder =
    "coloured/";  ///< below a level's folder: the level with these colours

/// What a task takes, told before there is a level. \param faces  of the level below
/// \param around  a block with what lies around it, blocks
std::uint64_t level_colour_bytes(std::uint64_t faces, std::uint64_t around);

/// Stage "colours" in the folder of a level.
/// \param decimated, below  the level as decimation left it, and the one it was made of; both with colours
/// \param radius            that decimation kept to, scan units
std::unique_ptr<Stage> make_level_colour_stage(MeshStore decimated, MeshStore below, double radius);

}  // namespace tessera
