/// \file hole_limit.h
/// Which holes of the welded mesh are filled: `--max-hole` as the stages read it.
#pragma once
#include <cstdint>
#include <filesystem>
#include <limits>

#include "stream/points/plan.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/scan/orient_sight.h"
#include "stream/stages/surface/hole_files.h"

namespace tessera {

struct HoleLimit {
  std::uint32_t edges = 0;    ///< of the rim, at most; 0 = none are filled
  std::uint32_t chained = 0;  ///< of rims that no brick sees whole, at most; 0 = none
  double width = std::numeric_limits<double>::infinity();  ///< cells: 4 area / length of the rim, at most
  double min_cosine = -1.0;                                ///< between faces that meet in a smooth filling
  bool membranes = false;                                  ///< where no smooth one fits
  /// Of a batch of fillings.
  std::uint64_t filling_bytes() const {
    return edges > 0 ? (batch_vertices(edges) + (chained > 0 ? kChainedVertices : 0)) * (24 + 48) : 0;
  }
};

/// What a scan shows, as far as its holes go.
enum class HoleScene : std::uint8_t {
  kOther,
  kRoom,   ///< walls and what stands before them, seen from stations between: holes are shadows
  kAbove,  ///< the top surface stands for some of the points
};

/// auto, in noisy scans: in scenes from above, where most holes are gaps in steep faces, and in sparse scans, whose points lie
/// farther apart than cells, what is narrower than 20 cells and folds no farther than 143 degrees; in rooms what is narrower than
/// 10 cells and folds no farther than 120 degrees; elsewhere what is narrower than the support of a sample and folds no farther
/// than a right angle, since shreds at a border stand against each other, and a filling makes a spike of a gap. An exact scan
/// ends where it says.
inline HoleLimit hole_limit(const ReconstructOptions& options, const Plan& plan, HoleScene scene) {
  if (options.max_hole != "auto") return {.edges = options.max_hole_edges()};
  if (!options.smooths_border() || !(plan.noise_cells > 0.0)) return {};
  if (scene == HoleScene::kAbove || plan.is_sparse())
    return {.edges = kMaxShortEdges,
            .chained = kMaxChainedEdges,
            .width = 20.0,
            .min_cosine = -0.8,
            .membranes = true};
  // Rooms are full of borders: strips around longer rims take in more faces than a brick holds at once.
  if (scene == HoleScene::kRoom)
    return {.edges = kNarrowEdges,
            .chained = kMaxRoomEdges,
            .width = 10.0,
            .min_cosine = -0.5,
            .membranes = true};
  return {.edges = kNarrowEdges, .width = plan.radius_cells, .min_cosine = 0.0};
}

inline HoleLimit hole_limit(const JobState& state, const Plan& plan) {
  const auto left = [&](const char* name) { return std::filesystem::exists(state.work / name); };
  return hole_limit(reconstruct_options(state), plan,
                    left(kSurfacePointFolder) ? HoleScene::kAbove
                    : left(kRoomFile)         ? HoleScene::kRoom
                                              : HoleScene::kOther);
}

}  // namespace tessera
