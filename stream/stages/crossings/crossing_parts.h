/// \file crossing_parts.h
/// What the passes of crossing_stages.h share.
#pragma once
#include <memory>
#include <optional>
#include <string>

#include "stream/stages/crossings/crossing_stages.h"

namespace tessera {

std::unique_ptr<Stage> make_crossing_search_stage(const JobState& state, const CrossingPlan& plan);
std::unique_ptr<Stage> make_crossing_mend_stage(const JobState& state, const CrossingPlan& plan);
std::unique_ptr<Stage> make_self_union_stage(const JobState& state, const CrossingPlan& plan);

inline std::string crossing_search_name(const CrossingPlan& plan) {
  return plan.prefix + "crossings";
}
inline std::string crossing_mend_name(const CrossingPlan& plan) {
  return plan.prefix + "mend";
}

inline std::string self_union_name(const CrossingPlan& plan) {
  return plan.prefix + "unite";
}

/// What mending could not mend, for the pass behind it; the only record of its file.
struct LeftPairs {
  std::uint64_t pairs = 0;
  Double3 place = {0, 0, 0};  ///< of one of them
};
inline constexpr const char* kLeftPairsFile = "left.pairs";
/// The mesh with what was mended, before surfaces that pass through each other are united.
MeshStore open_before_union(const JobState& state, const CrossingPlan& plan);

/// Where the output holds a position; empty where it holds it as it is.
std::function<Double3(const Double3&)> written_position(const MeshPlacement& placement);

/// All faces that meet a box, as MeshStore::load_box() loads them, a patch at a time: none where they are more than `max_faces`.
std::optional<MeshBlock> load_faces(const MeshStore& store, const MeshBox& box, std::size_t max_faces);
/// Per face whether its box meets this one.
std::vector<std::uint8_t> faces_in_box(const MeshBlock& block, const MeshBox& box);

/// Of a tile of the search that reads so many vertices and faces; of the end of the mending where there are so many pairs.
std::uint64_t crossing_tile_bytes(std::uint64_t vertices, std::uint64_t faces);
/// Of the largest tile, of a mesh of so many faces that lie evenly.
std::uint64_t crossing_search_bytes(const RunOptions& run, std::uint64_t faces);
std::uint64_t crossing_mend_stage_bytes(std::uint64_t pairs, std::uint64_t largest_patch_bytes);

}  // namespace tessera
