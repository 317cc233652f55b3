/// \file planned_patches.h
/// Patches as a plan can tell them before there are any: for the stages that read them.
#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/meshes/patch_store.h"
#include "stream/points/point_store.h"
#include "stream/stages/plan/tile.h"

namespace tessera {

inline constexpr double kVerticesPerFace = 0.6;  ///< those at seams are there in every patch

/// Patches of all bricks that hold points, as far as a plan can tell; first of every group of tiles, and one past.
struct PlannedPatches {
  std::vector<PatchEntry> entries;
  std::vector<std::size_t> first;
  /// The most that a task over the patches of one file takes.
  std::uint64_t max_of_tasks(std::uint64_t (*task_bytes)(std::span<const PatchEntry>)) const {
    std::uint64_t maximum = 0;
    for (std::size_t f = 0; f + 1 < first.size(); ++f)
      maximum = std::max(maximum, task_bytes({entries.data() + first[f], first[f + 1] - first[f]}));
    return maximum;
  }
  std::uint64_t components() const {
    std::uint64_t all = 0;
    for (const PatchEntry& e : entries) all += e.components;
    return all;
  }
};

/// Faces go to bricks by their occupied blocks, half as many again as the mean: no patch should have more.
PlannedPatches plan_patches(std::span<const BrickEntry> bricks, const std::vector<TileGroup>& groups,
                            std::uint64_t faces);

}  // namespace tessera
