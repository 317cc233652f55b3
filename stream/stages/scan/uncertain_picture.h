/// \file uncertain_picture.h
/// Where the signs of normals are in doubt: the thinned surfels of a job, red where they are.
#pragma once
#include <filesystem>

#include "stream/points/point_overlay.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// OUTPUT.uncertain.png
std::filesystem::path uncertain_picture_path(const std::filesystem::path& output);

/// OUTPUT.uncertain.ply: the surfels, coloured as stream/render/doubt.h reads them
std::filesystem::path uncertain_points_path(const std::filesystem::path& output);

/// Writes the points, and draws four views of them.
/// \throws ResourceError when the disk is full or no renderer is there
void draw_uncertain(const PointOverlay& overlay, const OverlayDecisions& decisions, const Lattice& lattice,
                    const std::filesystem::path& output, std::uint64_t memory_bytes,
                    const TaskContext& context);

}  // namespace tessera
