/// \file uncertain_picture.h
/// Where the signs of normals are in doubt: the thinned surfels of a job, red where they are.
#pragma once
#include <filesystem>

#include "stream/points/point_overlay.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// OUTPUT.uncertain.png
std::filesystem::path uncertain_picture_path(const std::filesystem::path& output);

/// Draws four views, through a small point file beside the picture that goes again.
/// \throws ResourceError when the disk is full or no renderer is there
void draw_uncertain(const PointOverlay& overlay, const OverlayDecisions& decisions, const Lattice& lattice,
                    const std::filesystem::path& picture, std::uint64_t memory_bytes,
                    const TaskContext& context);

}  // namespace tessera
