/// \file crossing_stages.h
/// Passes over a store of any size that leave no faces that cross, overlap or touch beyond what they share:
///
///   crossings  finds the pairs, tile by tile, exactly, as the positions will be written
///   mend       group by group, cuts the faces of the pairs out and closes the holes anew (kernels/holes/crossing_mend.h); writes
///              the patches in which faces changed
///   unite      of --crossings repair alone, where pairs are left: closed surfaces that pass through each other or themselves become the
///              boundary of what they hold, in memory (kernels/boolean/self_union.h); else the job ends with why that is not possible
///
/// Everything else keeps its bytes. Pairs that another mesh has at the same place, from which the store was made, stay.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_precision.h"
#include "stream/import/import_needs.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// As MeshStore's constructor takes them.
struct StoreFiles {
  std::vector<std::filesystem::path> files, newer = {};
};

struct CrossingPlan {
  std::string prefix = {};                          ///< of the names of the stages: "input-"
  std::function<StoreFiles(const JobState&)> mesh;  ///< where pairs are looked for; it stays
  /// What the mesh was made of: its own pairs are no fault of the job. Empty: every pair is mended.
  std::function<std::vector<MeshStore>(const JobState&)> given = {};
  std::function<double(const JobState&)> given_margin =
      {};  ///< how far from there the mesh may lie; empty: 0
  std::function<bool(const JobState&)> due =
      {};  ///< whether there is something to do, once it is known; empty: yes
  std::function<MeshPlacement(const JobState&)> placed =
      {};                  ///< how the output holds positions; empty: as they are
  bool may_cut = false;    ///< parts at a border may go where nothing else helps
  bool asked_for = false;  ///< by --crossings repair: nothing may be left
  bool final =
      false;  ///< of a result that nothing comes after: what is left is warned of, much of it is refused
  bool strict = false;  ///< whatever the final one leaves is refused
  bool hands_on =
      false;            ///< faces of pairs that stay go to kLeftFacesFile: another round keeps away from them
  bool gentle = false;  ///< borders go inwards before faces are taken out (CrossingMendOptions)
  bool tells_only = false;       ///< nothing is mended
  std::uint32_t generation = 0;  ///< below 2^20: keys of new vertices are apart for each of a job's plans
};

/// In the folder of the mending, where pairs stay that are the job's own: FailedFace records (failed_regions.h).
inline constexpr const char* kLeftFacesFile = "left.faces";

/// What --crossings repair does to an imported mesh before anything else. \param folder  of the import
CrossingPlan input_mend(const std::string& folder);
inline constexpr const char* kInputMendPrefix = "input-";

std::vector<StageEntry> crossing_stages(const CrossingPlan& plan);
/// The mesh as it is found, and with what was mended. \pre of the latter: the stages are done
MeshStore open_to_mend(const JobState& state, const CrossingPlan& plan);
MeshStore open_mended(const JobState& state, const CrossingPlan& plan);

/// What the report tells of them: {crossing_pairs, inherited_groups, mended_groups, left_groups, left_pairs, faces_removed,
/// faces_added, left [places], united where surfaces were}; null where the stages were idle.
Json mending_of(const Json& report, const std::string& prefix = "");

/// Of both stages for a mesh of so many faces that no pair is in.
std::vector<StageNeed> crossing_needs(const CrossingPlan& plan, const MeshSize& mesh,
                                      std::uint64_t patch_vertices);

}  // namespace tessera
